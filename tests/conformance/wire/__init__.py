"""Every command between every presented model and every mount, played and compared with the tables."""
