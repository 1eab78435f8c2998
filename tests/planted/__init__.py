"""Mistakes planted into the files of recordings, by code that shares nothing with the checks that look for them."""
