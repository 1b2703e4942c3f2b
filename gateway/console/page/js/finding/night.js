// The night at the selected mount: asked of the gateway once in a while, for the list and for the cards.

import { ask } from "../core/socket.js";
import { gatewayNow, mount, state } from "../core/store.js";
import { Night } from "./tonight.js";

const RENEW = 1800;
let known = null;
let asked = null;

/** The present night; null until it is known, and while the site is unknown. @returns {Night | null} */
export function night() {
  return known && known.key === key() ? known.night : null;
}

const key = () => JSON.stringify([state.chosen, mount()?.site, Math.floor(gatewayNow() / RENEW)]);

/** Ask for it, if it is not known. @returns {Promise<Night | null>} */
export async function nightNow() {
  if (night()) return night();
  const mine = key();
  if (asked?.key !== mine) asked = { key: mine, answer: ask({ do: "night" }) };
  const answer = await asked.answer;
  if (answer.ok && answer.begins !== null) known = { key: mine, night: new Night(answer) };
  else asked = null;
  return night();
}
