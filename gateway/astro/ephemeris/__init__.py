"""The sky over a site: sidereal time, azimuth and altitude, equinox of date, Sun, Moon and planets."""
