"""Compiled kernels: scalar maths on plain arrays, no checks, nan where undefined.

Every kernel is serial and releases the GIL; `pipecore.parallel` runs it on chunks in
threads. That needs no threading layer of numba's and gives the same bits whatever the
number of threads.
"""
