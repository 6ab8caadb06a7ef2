"""Speeds that others published, for the record; none of them was measured here."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PublishedSpeed:
    """A figure from a paper or a talk.

    Attributes
    ----------
    system, hardware, work : str
        Whose, on what, doing what.
    milliseconds : tuple of float
        Lowest and highest.
    source : str
        Where it was read.
    gather : tuple of int, optional
        Columns, rows and N of a gather that does the same work, which is timed beside it where the scene allows.
    """

    system: str
    hardware: str
    work: str
    milliseconds: tuple[float, float]
    source: str
    gather: tuple[int, int, int] | None = None


YUKSEL_KEYSER = "C. Yuksel, J. Keyser, Fast Real-time Caustics from Height Fields, 2009"
COLLARD_MUNDI = "Collard & Mundi, as published"
RAY_GUIDED = "NVIDIA, ray-guided water caustics; second-hand"

PUBLISHED = (
    PublishedSpeed(
        "Yuksel & Keyser", "GeForce 9600 GT", "400 x 300 map, N = 7, M = 6", (1.04, 1.04), YUKSEL_KEYSER, (400, 300, 7)
    ),
    PublishedSpeed("Yuksel & Keyser", "GeForce 9600 GT", "800 x 600 map", (3.3, 3.3), YUKSEL_KEYSER, (800, 600, 7)),
    PublishedSpeed(
        "Collard & Mundi", "RX 5700 XT", "whole 1080p frame, 1024² maps, 160² vertices", (4.2, 4.2), COLLARD_MUNDI
    ),
    PublishedSpeed(
        "Collard & Mundi", "RTX 3070", "whole 1080p frame, 1024² maps, 160² vertices", (2.2, 2.2), COLLARD_MUNDI
    ),
    PublishedSpeed("NVIDIA ray-guided, pool", "RTX 2060", "1024² map, 1080p", (1.02, 1.7), RAY_GUIDED),
    PublishedSpeed("NVIDIA ray-guided, pool", "RTX 3090", "1024² map, 1080p", (0.38, 0.55), RAY_GUIDED),
    PublishedSpeed("NVIDIA ray-guided, 4 cascades", "RTX 2060", "240 m sea", (4.89, 4.89), RAY_GUIDED),
    PublishedSpeed("NVIDIA ray-guided, 4 cascades", "RTX 3090", "240 m sea", (1.6, 1.6), RAY_GUIDED),
)
