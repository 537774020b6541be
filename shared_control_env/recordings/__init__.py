"""Recordings of drives: one Parquet file each, and the dataset that they make together."""
