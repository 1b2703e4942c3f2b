// Filters the exchanges that are shown: all, programs only, refusals only; one program; containing a text.

/** @typedef {{what: "programs"|"refused"|"all", side: string, text: string}} Filter */

/** @param {import("./exchanges.js").Exchange} exchange @param {Filter} filter */
export function passes(exchange, filter) {
  if (filter.what === "refused" && !exchange.refused) return false;
  if (filter.what === "programs" && exchange.own && !exchange.refused) return false;
  if (filter.side && exchange.side !== filter.side) return false;
  if (!filter.text) return true;
  const wanted = filter.text.toLowerCase();
  return [exchange.command, ...exchange.mountRows, ...exchange.replies].some(
    (row) => row && (row.data.toLowerCase().includes(wanted) || row.words.toLowerCase().includes(wanted)));
}
