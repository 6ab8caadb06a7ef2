"""Device code: Warp functions, structs and kernels, one file per pass. Knows Warp alone; no I/O, no host decisions."""
