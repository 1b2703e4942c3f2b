// Wires the parts together; each of them looks after its own place on the page.

import * as banners from "./banners.js";
import * as chart from "./chart.js";
import * as control from "./control.js";
import * as glance from "./glance.js";
import * as header from "./header.js";
import * as jog from "./jog.js";
import * as more from "./more.js";
import * as night from "./night.js";
import * as place from "./place.js";
import * as readings from "./readings/readings.js";
import * as search from "./search.js";
import * as socket from "./socket.js";
import * as stop from "./stop.js";
import { state } from "./store.js";
import * as talk from "./talk/talk.js";
import * as views from "./views.js";

stop.start(); // before anything else, so that whatever fails below leaves it
for (const part of [night, header, banners, glance, search, place, control, jog, readings, talk, more, views]) part.start();
socket.on("open", () => state.pin && socket.ask({ do: "pin", pin: state.pin }).then((answer) => (state.act ||= answer.ok)));
socket.connect();
chart.startOrSay();
