"""The sky: spherical geometry, positions of Sun, Moon and planets, and catalogues of objects."""
