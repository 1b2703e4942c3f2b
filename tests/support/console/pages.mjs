/**
 * Runs the console's scripts for motion by hand, one page after another, without a browser: reads requests as JSON from
 * standard input, one a line, and answers each with what the page has sent. Every page is a context of its own with its
 * own clock, which stands still between two requests.
 */
import { readFileSync } from "node:fs";
import { createInterface } from "node:readline";
import { pathToFileURL } from "node:url";
import vm from "node:vm";

const folder = pathToFileURL(`${process.argv[2]}/`);
const texts = new Map();

const source = (url) => {
  if (!texts.has(url)) texts.set(url, readFileSync(new URL(url), "utf-8"));
  return texts.get(url);
};

class Listening {
  constructor() {
    this.listeners = {};
  }
  addEventListener(name, listener) {
    (this.listeners[name] ??= []).push(listener);
  }
  fire(name, event = {}) {
    for (const listener of [...(this.listeners[name] ?? [])]) listener({ preventDefault() {}, target: this, ...event });
  }
}

class Element extends Listening {
  constructor(parts = [], dataset = {}) {
    super();
    Object.assign(this, { parts, dataset, children: [], textContent: "", value: "", disabled: false, hidden: false });
    this.style = { setProperty() {} };
    this.classList = { toggle() {} };
  }
  querySelectorAll(what) {
    if (what === "b") return [(this.letter ??= new Element())];
    const go = /^\[data-go(?:="(\w+)")?\]$/.exec(what);
    return go ? this.parts.filter((part) => !go[1] || part.dataset.go === go[1]) : [];
  }
  querySelector(what) {
    return this.querySelectorAll(what)[0] ?? null;
  }
  append(...children) {
    this.children.push(...children);
  }
  replaceChildren(...children) {
    this.children = children.filter((child) => child !== null);
  }
  setAttribute() {}
  getAttribute() {
    return null;
  }
  setPointerCapture() {}
  contains(other) {
    return this.parts.includes(other);
  }
  get words() {
    return this.children.map((child) => (child instanceof Element ? child.words : String(child))).join(" ");
  }
}

class Page {
  constructor(at) {
    this.now = at;
    this.sent = [];
    this.timers = [];
    this.socket = null;
    this.notices = [];
    this.number = 0;
  }

  async load() {
    const page = this;
    const arrows = ["north", "south", "east", "west"].map((go) => new Element([], { go }));
    const ids = { pad: new Element(arrows), notices: new Element() };
    const show = ids.notices.replaceChildren.bind(ids.notices);
    ids.notices.replaceChildren = (...children) => {
      show(...children);
      if (ids.notices.words) page.notices.push(ids.notices.words);
    };
    this.pad = ids.pad;
    this.window = new Listening();
    this.document = new Listening();
    Object.assign(this.document, {
      hidden: false,
      body: new Element(),
      getElementById: (id) => (ids[id] ??= new Element()),
      createElement: () => new Element(),
      querySelector: () => ({ getAttribute: () => "token" }),
      querySelectorAll: () => [],
    });
    this.location = { protocol: "http:", host: "x", hash: "#/control", reload() {} };
    class WebSocket extends Listening {
      static OPEN = 1;
      constructor() {
        super();
        this.readyState = 0;
        page.socket = this;
      }
      send(text) {
        page.sent.push(text);
      }
      close() {
        this.readyState = 3;
        page.sent.push(null);
      }
    }
    const timer = (does, ms, every) => {
      page.timers.push({ id: ++page.number, at: page.now + ms, does, every });
      return page.number;
    };
    const globals = {
      console, document: this.document, location: this.location, WebSocket, URL, JSON, Map, Set, encodeURIComponent,
      Node: Element, HTMLTextAreaElement: class {}, HTMLInputElement: class {}, AbortSignal: { timeout() {} },
      localStorage: { getItem: () => null, setItem() {} },
      performance: { now: () => page.now },
      addEventListener: (...all) => this.window.addEventListener(...all),
      setTimeout: (does, ms) => timer(does, ms, 0),
      setInterval: (does, ms) => timer(does, ms, ms),
      clearTimeout: (id) => (page.timers = page.timers.filter((one) => one.id !== id)),
      requestAnimationFrame: (does) => timer(does, 16, 0),
      fetch: async () => ({ text: async () => "" }),
      DOMParser: class {
        parseFromString() {
          return { querySelector: () => ({ getAttribute: () => "token" }) };
        }
      },
    };
    const context = vm.createContext(globals);
    const modules = new Map();
    const linked = (url) => {
      if (!modules.has(url)) modules.set(url, new vm.SourceTextModule(source(url), { context, identifier: url }));
      return modules.get(url);
    };
    const get = async (name) => {
      const module = linked(new URL(name, folder).href);
      if (module.status === "unlinked") await module.link((to, from) => linked(new URL(to, from.identifier).href));
      if (module.status === "linked") await module.evaluate();
      return module.namespace;
    };
    (await get("control/jog.js")).start();
    (await get("core/views.js")).start();
    (await get("core/socket.js")).connect();
  }

  /** Let the timers run that are due at a time, milliseconds. */
  async until(at) {
    for (;;) {
      const due = this.timers.filter((one) => one.at <= at).sort((one, other) => one.at - other.at)[0];
      if (!due) break;
      this.now = Math.max(this.now, due.at);
      if (due.every) due.at += due.every;
      else this.timers = this.timers.filter((one) => one !== due);
      due.does();
      await settled();
    }
    this.now = Math.max(this.now, at);
  }
}

const settled = () => new Promise((resolve) => setImmediate(resolve));

const does = {
  opened: (page) => {
    page.socket.readyState = 1;
    page.socket.fire("open");
  },
  message: (page, text) => page.socket?.readyState === 1 && page.socket.fire("message", { data: text }),
  closed: (page, code) => page.socket?.fire("close", { code }),
  press: (page, go, pointerId) => page.pad.querySelector(`[data-go="${go}"]`).fire("pointerdown", { button: 0, pointerId }),
  release: (page, pointerId) => page.window.fire("pointerup", { pointerId }),
  rate: (page, key) => page.window.fire("keydown", { key: String(key) }),
  blur: (page) => page.window.fire("blur"),
  leave: (page) => page.window.fire("pagehide"),
  view: (page, name) => {
    page.location.hash = `#/${name}`;
    page.window.fire("hashchange");
  },
  wait: () => undefined,
};

const pages = new Map();
for await (const line of createInterface({ input: process.stdin })) {
  const [number, at, name, ...more] = JSON.parse(line);
  if (name === "load") {
    const page = new Page(at);
    pages.set(number, page);
    await page.load();
  }
  const page = pages.get(number);
  await page.until(at);
  does[name]?.(page, ...more);
  await settled();
  const next = Math.min(...page.timers.map((one) => one.at));
  process.stdout.write(`${JSON.stringify({ sent: page.sent, notices: page.notices, next })}\n`);
  page.sent = [];
  page.notices = [];
}
