"""System identification: chapter 3 and 4 of the thesis, and what a practitioner would use beside it."""
