"""Names of stars, and the Hipparcos number of each: what alignment lists and charts call the brightest ones.

Where a name has been given to several stars it means the one that the International Astronomical Union gave it to:
Gienah is in Corvus, Algenib in Pegasus, Toliman the fainter star of Alpha Centauri.
"""

from __future__ import annotations

HIPPARCOS = {
    "Acamar": 13847, "Achernar": 7588, "Acrab": 78820, "Acrux": 60718, "Acubens": 44066, "Adhara": 33579, "Ain": 20889,
    "Albali": 102618, "Albireo": 95947, "Alcor": 65477, "Alcyone": 17702, "Aldebaran": 21421, "Alderamin": 105199,
    "Alfirk": 106032, "Algenib": 1067, "Algieba": 50583, "Algol": 14576, "Algorab": 60965, "Alhena": 31681,
    "Alioth": 62956, "Aljanah": 102488, "Alkaid": 67301, "Alkes": 53740, "Almaaz": 23416, "Almach": 9640,
    "Alnair": 109268, "Alnasl": 88635, "Alnilam": 26311, "Alnitak": 26727, "Alphard": 46390, "Alphecca": 76267,
    "Alpheratz": 677, "Alrescha": 9487, "Alsephina": 42913, "Alshain": 98036, "Altair": 97649, "Altais": 94376,
    "Aludra": 35904, "Ankaa": 2081, "Antares": 80763, "Arcturus": 69673, "Arneb": 25985, "Ascella": 93506,
    "Asellus Australis": 42911, "Asellus Borealis": 42806, "Aspidiske": 45556, "Atlas": 17847, "Atria": 82273,
    "Avior": 41037, "Barnard's Star": 87937, "Bellatrix": 25336, "Betelgeuse": 27989, "Canopus": 30438,
    "Capella": 24608, "Caph": 746, "Castor": 36850, "Cebalrai": 86742, "Chara": 61317, "Chertan": 54879,
    "Cor Caroli": 63125, "Cursa": 23875, "Dabih": 100345, "Deneb": 102098, "Deneb Algedi": 107556, "Denebola": 57632,
    "Diphda": 3419, "Dschubba": 78401, "Dubhe": 54061, "Edasich": 75458, "Electra": 17499, "Elnath": 25428,
    "Eltanin": 87833, "Enif": 107315, "Errai": 116727, "Fomalhaut": 113368, "Furud": 30122, "Gacrux": 61084,
    "Garnet Star": 107259, "Gienah": 59803, "Gomeisa": 36188, "Hadar": 68702, "Hamal": 9884, "Homam": 112029,
    "Izar": 72105, "Kaus Australis": 90185, "Kaus Borealis": 90496, "Kaus Media": 89931, "Kitalpha": 104987,
    "Kochab": 72607, "Kornephoros": 80816, "Kraz": 61359, "La Superba": 62223, "Larawag": 82396, "Lesath": 85696,
    "Maia": 17573, "Markab": 113963, "Markeb": 45941, "Matar": 112158, "Mebsuta": 32246, "Megrez": 59774,
    "Meissa": 26207, "Menkalinan": 28360, "Menkar": 14135, "Menkent": 68933, "Merak": 53910, "Merope": 17608,
    "Mesarthim": 8832, "Miaplacidus": 45238, "Mimosa": 62434, "Mintaka": 25930, "Mira": 10826, "Mirach": 5447,
    "Mirfak": 15863, "Mirzam": 30324, "Mizar": 65378, "Muphrid": 67927, "Naos": 39429, "Navi": 4427, "Nekkar": 73555,
    "Nihal": 25606, "Nunki": 92855, "Peacock": 100751, "Phact": 26634, "Phecda": 58001, "Pherkad": 75097,
    "Pleione": 17851, "Polaris": 11767, "Pollux": 37826, "Porrima": 61941, "Procyon": 37279, "Propus": 29655,
    "Proxima Centauri": 70890, "Rasalgethi": 84345, "Rasalhague": 86032, "Rastaban": 85670, "Regor": 39953,
    "Regulus": 49669, "Rigel": 24436, "Rigil Kentaurus": 71683, "Rotanev": 101769, "Ruchbah": 6686, "Rukbat": 95347,
    "Sabik": 84012, "Sadachbia": 110395, "Sadalmelik": 109074, "Sadalsuud": 106278, "Sadr": 100453, "Saiph": 27366,
    "Sargas": 86228, "Scheat": 113881, "Schedar": 3179, "Segin": 8886, "Seginus": 71075, "Shaula": 85927,
    "Sheliak": 92420, "Sheratan": 8903, "Sirius": 32349, "Spica": 65474, "Sualocin": 101958, "Suhail": 44816,
    "Sulafat": 93194, "Talitha": 44127, "Tania Australis": 50801, "Tania Borealis": 50372, "Tarazed": 97278,
    "Taygeta": 17531, "Tejat": 30343, "Thuban": 68756, "Tiaki": 112122, "Toliman": 71681, "Unukalhai": 77070,
    "Vega": 91262, "Vindemiatrix": 63608, "Wasat": 35550, "Wezen": 34444, "Yed Prior": 79593, "Zaurak": 18543,
    "Zosma": 54872, "Zubenelgenubi": 72622, "Zubeneschamali": 74785,
}  # fmt: skip
#: Other names of these, as charts, hand controls and people write them.
ALSO = {
    "Agena": "Hadar", "Alcaid": "Alkaid", "Alpha Centauri": "Rigil Kentaurus", "Becrux": "Mimosa",
    "Benetnash": "Alkaid", "Beta Centauri": "Hadar", "Betelgeux": "Betelgeuse", "Deneb Kaitos": "Diphda",
    "Dog Star": "Sirius", "Etamin": "Eltanin", "Gemma": "Alphecca", "Graffias": "Acrab",
    "Herschel's Garnet Star": "Garnet Star", "Marfak": "Mirfak", "Murzim": "Mirzam", "North Star": "Polaris",
    "Phad": "Phecda", "Phecta": "Phecda", "Pole Star": "Polaris",
    "Rigel Kent": "Rigil Kentaurus", "Rigel Kentaurus": "Rigil Kentaurus", "Schedir": "Schedar", "Sirrah": "Alpheratz",
    "Suhail Al Muhlif": "Regor",
}  # fmt: skip
