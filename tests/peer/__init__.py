"""The caustic map of waves over a plane by a renderer that this project did not write: Mitsuba 3's ``ptracer``.

How the two can give one answer
-------------------------------
``ptracer`` follows light particles from an emitter and connects every surface that they meet with the sensor. The scene
is built so that each pixel measures the irradiance E of the floor beneath it, and nothing else:

* *Light.* A parallelogram above the water, perpendicular to the sun, emits along its normal alone
  (``directionalarea``, whose ``radiance`` is the power by area, thus the sun's irradiance). It covers the water that
  lights the map; the water is wider than it, or light would pass by the water's edge without refraction.
* *Water.* A fine mesh with the normals of the waves themselves at its vertices, of the BSDF ``dielectric``. A particle
  is refracted or reflected by chance, with Fresnel's reflectance, and keeps its power: particles carry importance, so
  no factor of the squared index applies. There is no dielectric without Fresnel's reflection and ``ptracer`` knows no
  medium: ``fresnel`` must be true, and ``absorption`` zero.
* *Floor.* Diffuse with reflectance 1: its radiance is E / pi in every direction, so the map is pi times the picture.
* *One refraction, one landing.* ``max_depth = 3`` ends a path at its second surface: water, then floor, then sensor.
  The connection at the water is zero, since a smooth interface sends nothing towards a point; what the water reflects,
  or lets out again, ends at a surface that is water or at none; what the floor sends up is not followed. Direct sight
  of the emitter is switched off.
* *Sensor.* A pinhole over the middle of the map, under the deepest trough, that looks straight down. The picture of a
  plane through it is an affine map, so pixels line up exactly with those of the caustic map; with a box filter a pixel
  is the mean over its square. A particle that lands in the direction theta weighs cos(theta) (diffuse) cos^2(theta)
  (distance) / cos^3(theta) (the sensor's importance) = 1: all of them the same. So a pixel is a count of independent
  particles, and its variance is in proportion to its mean.

What remains different
----------------------
Rays start a little beside the surface: by ``(1 + max|p|) * 1500 * 2^-24`` along its normal
(``Interaction::offset_p``). Light thus lands ``m (n_xy + n_z R_xy / |R_z|)`` short, ``m`` being that distance. About
the water at the middle of the map, and with lengths scaled up until the 1 is small, ``m`` is least. The mesh is flat
between its vertices, and its normals are interpolated. The peer's ``landing_error`` is what both come to.

The water and its slopes come from ``tests/oracle``, not from the library.
"""

from __future__ import annotations

from peer.tracer import Peer, PeerMap, z_scores

__all__ = ["Peer", "PeerMap", "z_scores"]
