"""Kernels that several packages share: arrays first, keyword-only numbers after, arrays back."""
