// Connects to the gateway before the modules of the page are there, because that takes as many round trips as they do:
// core/socket.js takes this connection over, with what was heard on it until then.
(() => {
  const token = document.querySelector('meta[name="token"]').getAttribute("content");
  const early = new WebSocket(`${location.protocol === "https:" ? "wss:" : "ws:"}//${location.host}/socket?token=${encodeURIComponent(token)}`);
  const heard = [];
  early.onmessage = (event) => heard.push(event);
  globalThis.early = { ws: early, heard };
})();
