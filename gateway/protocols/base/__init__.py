"""What every protocol is made of: a surface towards programs, a driver towards mounts, frames."""
