"""The parts shared by all blocks: kernels, ticks, noise, frames and messages, and the error for bad input."""
