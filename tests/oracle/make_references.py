"""Make the stored references anew: ``PYTHONPATH=tests python -m oracle.make_references``."""

from __future__ import annotations

import time

import numpy as np

from oracle.cases import CASES, Case
from oracle.reference import ideal_map, reference_map, relative_l2
from oracle.store import StoredReference, save_references


def make(case: Case) -> StoredReference:
    """Compute one case, and how far plain triangles stay from it."""
    scene = case.scene_dict()
    made = reference_map(scene, case.time, case.oversample)
    rising, falling = (
        relative_l2(ideal_map(scene, case.time, falling=falling).caustic_map, made.caustic_map)
        for falling in (False, True)
    )
    energy = {key: np.asarray(value).tolist() for key, value in made.energy.items()}
    return StoredReference(made.caustic_map, energy, made.error, (rising, falling))


def main() -> None:
    """Make every case, store all, and print a table."""
    print(f"{'case':15}{'kind':10}{'error':>9}{'ideal':>9}{'other':>9}{'peak/mean':>11}{'seconds':>9}")
    references = {}
    for name, case in CASES.items():
        start = time.perf_counter()
        made = references[name] = make(case)
        took = time.perf_counter() - start
        peak = made.caustic_map.max() / made.caustic_map.mean()
        rising, falling = made.ideal_error
        print(f"{name:15}{case.kind:10}{made.error:9.1e}{rising:9.1e}{falling:9.1e}{peak:11.1f}{took:9.1f}", flush=True)
    save_references(references)


if __name__ == "__main__":
    main()
