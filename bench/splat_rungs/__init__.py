"""Forms of the splat of given landing points, from the plainest to what a GPU may like best.

What a method of the library uses lies in ``kernels/splat.py``; here are the form that it replaced, which the others are
checked against, and those that no measurement has yet shown to be worth their memory.
"""
