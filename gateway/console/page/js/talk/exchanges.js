// Combines rows of the conversation into exchanges: a program's command, the exchanges with the mount, the reply.
// Rows that belong to no program are shown separately: the gateway's own questions, and events.

/**
 * @typedef {{mount: number, time: number, side: string, surface: string, arrow: string, data: string, words: string, kind: string, pair: number|null}} Row
 * @typedef {{key: string, mount: number, time: number, side: string, surface: string, command: Row|null, mountRows: Row[], replies: Row[], refused: boolean, own: boolean}} Exchange
 */

/** How many exchanges are stored. */
const MOST = 300;

export class Exchanges {
  /** @type {Exchange[]} */
  all = [];
  /** @type {Map<string, Exchange>} */
  #byPair = new Map();
  #number = 0;

  /** @param {Row[]} rows @returns {Set<Exchange>} the new and changed exchanges */
  add(rows) {
    const touched = new Set();
    for (const row of rows) touched.add(this.#put(row));
    while (this.all.length > MOST) this.#drop(this.all.shift());
    return touched;
  }

  #drop(exchange) {
    for (const [pair, known] of this.#byPair) if (known === exchange) this.#byPair.delete(pair);
  }

  #put(row) {
    const exchange = (row.pair !== null && this.#byPair.get(`${row.mount}/${row.pair}`)) || this.#begin(row);
    if (row.kind === "no" || row.arrow === "!") exchange.refused = true;
    if (row.side === "mount") exchange.mountRows.push(row);
    else if (row.arrow === ">" && !exchange.command) exchange.command = row;
    else exchange.replies.push(row);
    return exchange;
  }

  #begin(row) {
    const last = this.all.at(-1);
    // An answer of the mount that belongs to no program is shown with the question before it.
    if (row.pair === null && row.side === "mount" && row.arrow !== ">" && last?.own && last.mount === row.mount) return last;
    const exchange = {
      key: String(++this.#number), mount: row.mount, time: row.time, side: row.side, surface: row.surface, command: null, mountRows: [], replies: [],
      refused: false, own: row.side === "mount",
    };
    this.all.push(exchange);
    if (row.pair !== null) this.#byPair.set(`${row.mount}/${row.pair}`, exchange);
    return exchange;
  }
}

/** One exchange as lines of text, for the clipboard. @param {Exchange} exchange */
export const asText = (exchange) =>
  [exchange.command, ...exchange.mountRows, ...exchange.replies]
    .filter((row) => row !== null)
    .map((row) => `${new Date(row.time * 1000).toISOString()}  ${row.side.padEnd(22)} ${row.arrow} ${row.data}  ${row.words}`.trimEnd())
    .join("\n");
