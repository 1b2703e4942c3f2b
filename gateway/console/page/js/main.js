// Starts all parts of the page; each of them manages its own elements.

import * as gamepad from "./control/gamepad.js";
import * as jog from "./control/jog.js";
import * as look from "./control/look.js";
import * as orders from "./control/orders.js";
import * as steps from "./control/steps.js";
import * as labels from "./core/labels.js";
import * as socket from "./core/socket.js";
import { state } from "./core/store.js";
import * as views from "./core/views.js";
import * as chart from "./finding/chart.js";
import * as glance from "./finding/glance.js";
import * as place from "./finding/place.js";
import * as search from "./finding/search.js";
import * as awake from "./frame/awake.js";
import * as banners from "./frame/banners.js";
import * as header from "./frame/header.js";
import * as mounts from "./frame/mounts.js";
import * as night from "./frame/night.js";
import * as stop from "./frame/stop.js";
import * as more from "./more.js";
import * as readings from "./readings/readings.js";
import * as talk from "./talk/talk.js";

stop.start(); // first, so that it works even if something below fails
labels.write();
for (const part of [night, awake, header, mounts, banners, glance, search, place, look, orders, steps, jog, gamepad, readings, talk, more, views]) part.start();
socket.on("open", () => state.pin && socket.ask({ do: "pin", pin: state.pin }).then((answer) => (state.act ||= answer.ok)));
socket.connect();
chart.startOrSay();
