"""Configuration: YAML to frozen models; whatever is unknown, missing or impossible is refused."""
