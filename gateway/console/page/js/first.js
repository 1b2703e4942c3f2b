// Runs before the first paint: a page that was red when it was last open opens red, without a white flash.
// Without a stored value the hour decides until the gateway reports the altitude of the Sun.
(() => {
  const root = document.documentElement;
  let light = null;
  let step = null;
  try {
    light = localStorage.getItem("light-shown");
    step = localStorage.getItem("light-step");
  } catch {
    // Without storage the hour decides each time.
  }
  const hour = new Date().getHours();
  root.dataset.light = light ?? (hour >= 20 || hour < 6 ? "night" : "day");
  root.toggleAttribute("data-night", root.dataset.light === "night");
  root.dataset.step = step ?? "4";
})();
