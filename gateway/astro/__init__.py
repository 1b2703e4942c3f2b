"""The sky: spherical geometry, where Sun, Moon and planets stand, and catalogues of objects."""
