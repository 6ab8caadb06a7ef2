"""Measure every method on one scene: how wrong it is, how long it takes, and which settings no other one beats."""

import warp_caustics as wc

scene = wc.load_scene("pool").at_resolution(128, 128)
comparison = wc.compare(scene)  # methods=["beam", "gather"], device="cpu", threads=1, time=0.5, ... if wanted

print(f"errors are known to {comparison.reference.error_bar:.1e}, the error bar of the reference")
print(f"{'setting':22} {'ms':>8} {'error':>10} {'energy error':>13} {'bytes':>12}")
for row in comparison.front:  # fastest first; comparison.rows has them all
    print(
        f"{row.label:22} {row.speed.milliseconds:8.2f} {row.errors.relative_l2:10.4%} "
        f"{row.errors.energy_error:+13.1e} {row.speed.bytes:12,}"
    )
for path in comparison.save("out/compare_pool"):  # compare.json and compare.png
    print(path)
