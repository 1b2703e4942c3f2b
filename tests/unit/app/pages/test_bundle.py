"""A page: its sheets and plain scripts in it, its modules one file that the browser keeps until an update."""

from __future__ import annotations

import asyncio
import base64
import gzip
import hashlib
import re
from pathlib import Path

import pytest
from aiohttp import web
from aiohttp.test_utils import make_mocked_request

from gateway.app.pages import Pages, bundle_scripts

PAGE = """<link rel="stylesheet" href="a.css">
<link rel="stylesheet" href="b.css">
<script src="js/plain.js"></script>
<a href="#/x">{{word}}</a>
<script type="module" src="js/main.js"></script>"""
FILES = {
    "index.html": PAGE,
    "a.css": "a {}",
    "b.css": "b {}",
    "js/plain.js": "plain();",
    "js/main.js": 'import { one } from "./x/one.js";\none();\n',
    "js/x/one.js": "export const one = () => 1;\n",
}


def pages(folder: Path, **changed: str) -> Pages:
    for name, text in (FILES | changed).items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return Pages({name: folder / name for name in FILES})


def get(served: Pages, path: str, encoding: str = "") -> web.Response:
    request = make_mocked_request("GET", f"/{path}", {"Accept-Encoding": encoding}, match_info={"path": path})
    answer = asyncio.run(served.serve_file(request))
    assert isinstance(answer, web.Response)
    return answer


def text(answer: web.Response) -> str:
    assert isinstance(answer.body, bytes)
    packed = answer.headers.get("Content-Encoding") == "gzip"
    return (gzip.decompress(answer.body) if packed else answer.body).decode()


def links(served: Pages) -> list[str]:
    return re.findall(r'(?:href|src)="([^"#]+)"', text(index(served)))


def index(served: Pages, encoding: str = "") -> web.Response:
    return asyncio.run(served.serve_page(make_mocked_request("GET", "/", {"Accept-Encoding": encoding}), word="<x>"))


def test_page_script_is_cached_for_a_year_and_everything_else_is_inline(tmp_path: Path) -> None:
    served = pages(tmp_path)
    [script] = links(served)
    for encoding in ("", "gzip, deflate"):
        answer = get(served, script, encoding)
        assert "one();" in text(answer) and "max-age=31536000, immutable" in answer.headers["Cache-Control"]
        page = index(served, encoding)
        for one in (answer, page):
            assert (one.headers.get("Content-Encoding") == "gzip") == bool(encoding)
        assert "&lt;x&gt;" in text(page) and 'href="#/x"' in text(page) and page.headers["Cache-Control"] == "no-store"
    policy = page.headers["Content-Security-Policy"]
    for inside in ("<style>a {}</style>", "<style>b {}</style>", "<script>plain();</script>"):
        tag, body = inside[1:-1].split("<")[0].split(">")
        assert inside in text(page)
        digest = base64.b64encode(hashlib.sha256(body.encode()).digest()).decode()
        [source] = re.findall(f"{tag}-src ([^;]*)", policy)
        assert source.startswith("'self'") and f"'sha256-{digest}'" in source
    assert "unsafe" not in policy


def test_old_script_path_is_not_served_after_an_update(tmp_path: Path) -> None:
    before, after = links(pages(tmp_path)), pages(tmp_path, **{"js/x/one.js": "export const one = () => 2;\n"})
    assert not set(before) & set(links(after))
    for path in (*before, "nothing.js", "index.htm"):
        with pytest.raises(web.HTTPNotFound):
            get(after, path)
    assert get(after, "js/x/one.js").headers["Cache-Control"] == "no-cache"


def test_bundled_page_modules_run_once_in_import_order() -> None:
    made = bundle_scripts(
        {
            "js/main.js": 'import * as b from "./b.js";\nimport { a as first, two } from "./x/a.js";\nb.start(first);\n'
            'const later = import("./late.js");\n',
            "js/b.js": '// law\n/**\n * of it\n */\nimport { a } from "./x/a.js";\nexport function start() {} // end\n',
            "js/x/a.js": "export const a = 1, two = 2;\nexport const where = import.meta.url;\n",
            "js/late.js": "export class Late {}\n",
        },
        "js/main.js",
        "js",
    )
    assert "const { a: first, two } = get(0);" in made and "const b = get(1);" in made
    assert "law" not in made and "of it" not in made and "// end" in made
    assert "return { a, two, where };" in made and made.count("const a = 1") == 1
    assert 'new URL("x/a.js", import.meta.url)' in made and "Promise.resolve().then(() => get(2))" in made


@pytest.mark.parametrize("body", ["export default 1;", "export let a = 1;", 'import a from "./main.js";',
                                  'import { a } from "./main.js";'])  # fmt: skip
def test_page_bundle_rejects_unsupported_import_and_export_forms(body: str) -> None:
    with pytest.raises(ValueError, match="main"):
        bundle_scripts({"main.js": f"{body}\n"}, "main.js", "")
