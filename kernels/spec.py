"""What a scene makes the kernels do: a frozen value by which the factories of this folder build their kernels."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Spec:
    """The facts of a scene that decide which code a kernel contains.

    Attributes
    ----------
    water : str
        ``"waves"`` (a sum of sines), ``"grid"`` (a height map), ``"periodic"`` (one that repeats without end) or
        ``"radial"`` (rings around a point).
    declared : bool
        The bounds of the water are declared or sampled, as of a simulation or a sea: light past them is dropped.
    receiver : str
        ``"plane"``, ``"waves"`` (terrain in closed form), ``"grid"`` (terrain from a file) or ``"mesh"``.
    objects : bool
        Meshes stand on the receiver: a second intersection by BVH.
    bounded : bool
        The water ends at a border, of its height map or its basin: cells are clipped to it.
    shore : bool
        The receiver may rise above the water: wet and dry, and land that shades water.
    hills_shade : bool
        Parts of the terrain face away from the sun, so that hills shade dry land: a march towards the sun.
    occluders : bool
        A mesh may rise above the water: its shadow on the water by BVH.
    self_shadow : bool
        Crests shade troughs: a march towards the sun.
    faces_away : bool
        Parts of the surface may face away from the sun.
    exits : bool
        A refracted ray may meet the surface from below: a march along it.
    tears : bool
        Neighbouring rays may land far apart, on either side of an edge of the receiver.
    fresnel : bool
        Light is lost at the surface.
    attenuation : str
        ``"none"``, ``"path"`` (absorption along the refracted ray) or ``"depth"`` (Jerlov's K_d).
    channels : int
        1, or 3 where the attenuation differs by colour.
    backlund : bool
        Land by Bäcklund's Eq. 3.3 instead of exactly.
    accumulate : str
        ``"float32"``, ``"float64"`` or ``"fixed"``.
    """

    water: str = "waves"
    declared: bool = False
    receiver: str = "plane"
    objects: bool = False
    bounded: bool = False
    shore: bool = False
    hills_shade: bool = False
    occluders: bool = False
    self_shadow: bool = False
    faces_away: bool = False
    exits: bool = False
    tears: bool = False
    fresnel: bool = False
    attenuation: str = "none"
    channels: int = 1
    backlund: bool = False
    accumulate: str = "float32"

    @property
    def breaks(self) -> bool:
        """True where the corners of one cell may meet different fates, so that each needs a state."""
        return (
            self.objects or self.shore or self.occluders or self.self_shadow
            or self.faces_away or self.exits or self.tears or self.receiver == "mesh"
        )  # fmt: skip
