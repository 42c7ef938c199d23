"""Kernels that two stages share: arrays first, keyword numbers after, arrays back."""
