"""Render the same water by every method that takes its receiver, and compare where the light went."""

import numpy as np

import warp_caustics as wc

scene = wc.load_scene("pool")
results = {method: wc.render(scene, method=method) for method in ("beam", "photon", "gather")}
reference = results["beam"].caustic_map

print(f"{'method':8} {'ms':>8} {'received':>10} {'missed':>10} {'difference from beam':>22}")
for method, result in results.items():
    energy = result.energy
    difference = np.sqrt(np.mean((result.caustic_map - reference) ** 2)) / reference.mean()
    received = energy["received"] / energy["emitted"]
    missed = (energy["missed_by_window"] + energy["dropped"]) / energy["emitted"]
    print(f"{method:8} {1e3 * result.seconds:8.2f} {received:10.4%} {missed:10.4%} {difference:22.4f}")
