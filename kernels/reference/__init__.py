"""Device code of the converged reference: float64 throughout, and nothing from the kernels that it judges."""
