"""The parts that every block is made of: kernels, ticks, noise, frames, messages; and how input is refused."""
