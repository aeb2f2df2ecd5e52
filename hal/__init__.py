"""What touches the outside: boundary (api), data types, errors, clocks, cameras, chassis, links."""
