"""Stage 4 for a plant of the user's own: free-run simulations of whole runs on the recorded torque."""
