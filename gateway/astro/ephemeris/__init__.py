"""The sky over a site: sidereal time, alt-azimuth, equinox of date, Sun, Moon and planets."""
