"""Compilation of kernels: decorators, machine code in files, arguments, and scalar functions."""
