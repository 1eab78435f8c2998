"""From error to command: feedback laws, their gains, friction compensation."""
