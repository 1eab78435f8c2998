"""Stage 0: do the recordings agree with each other and with the model's dimensions?"""
