"""The planned path: where it goes, how fast it may be driven, where it cannot be seen round."""
