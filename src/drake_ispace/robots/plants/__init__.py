"""The dynamics of each robot as a Drake block, and what several of them share: slip, friction, their memory."""
