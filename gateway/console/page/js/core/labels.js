// The page's own labels in one table: what states, buttons, modes and readings are called. Sentences that answer, ask or
// explain stand where they are said.

/** What the heading and STOP say of states that the gateway has no words for. */
export const STATES = {
  connecting: "Connecting…", lost: "No connection", opening: "Connecting to the mount", down: "The mount does not answer", unaligned: "Not aligned", unknown: "nothing is known yet",
  stopping: "stopping…", owed: "not sent yet", notSent: "NOT sent: press again", allMounts: "all mounts", allMotion: "all motion",
};
/** Buttons. */
export const BUTTONS = {
  close: "Close", tonight: "Tonight", go: "Go there", going: "On its way…", again: "Go again", sync: "Sync…", syncHere: "Sync here…", keepList: "Keep this list", keep: "Keep it", centred: "It is centred: sync",
  pin: "Enter the pin", gamepad: "Use a gamepad here", wake: "Wake", hold: "Hold still", release: "Release", park: "Park…", home: "Home…", search: "Spiral search…", unpark: "Unpark", place: "Place", back: "Back", end: "End",
  narrow: "Narrow the limits…", configured: "As configured", time: "Use this device's time", site: "Set the site…", report: "Report", record: "Record", pause: "Pause", goOn: "Go on",
  copy: "Copy", field: "Field of view…", favourite: "☆ Favourite", isFavourite: "★ Favourite", seen: "Seen?", isSeen: "✓ Seen", ofDate: "of date", j2000: "J2000",
};
/** Headings of groups, and of questions with their answers. */
export const HEADINGS = {
  place: "Chosen place", tonight: "What is up tonight", own: "Paste or load a list", field: "What is your field of view?", tracking: "Tracking", follow: "Follow", park: "Park", home: "Go home", mount: "Mount",
  narrow: "Narrow the limits?", narrows: "Narrow", whereSite: "Where does the mount stand?", setSite: "Set the site", site: "Site and clock", line: "Line to the mount",
  programs: "Programs", points: "Where it points", does: "What it does", lately: "Lately", light: "Light", brightness: "Brightness of the red light: 1 dim, 6 full", page: "This page",
  guide: "Speed of guide pulses; 1 is the speed of the stars", surfaces: "Where programs connect", allowed: "What is allowed", keys: "Keys", pin: "Act from this page", act: "Act",
};
/** Readings. */
export const READINGS = {
  ra: "Right ascension", dec: "Declination", alt: "Altitude", az: "Azimuth", ra2000: "RA, J2000", dec2000: "Dec, J2000", hourAngle: "Hour angle", sidereal: "Sidereal time",
  pier: "Side of the pier", age: "Seen", now: "Now", ordered: "Ordered", goal: "On its way to", tracking: "Tracking", aligned: "Aligned", found: "Found", model: "Model", version: "Version",
  at: "Reached by", raShort: "RA", decShort: "Dec", altShort: "Alt", azShort: "Az", sets: "Sets", rises: "Rises", culminates: "Culminates", site: "Site", siteBy: "Set by", clock: "Clock",
  clockBy: "Clock set by", device: "This device", doubt: "In doubt",
};
/** Names of fields and groups. */
export const NAMES = {
  shown: "What is shown", contains: "Filter, like :MS", filter: "Show only exchanges with this text", side: "Of which program", everyProgram: "Every program",
  equinox: "Equinox of what was typed", file: "From a file", ownExample: "M 81\n05:34:32 +22:00:52 J2000",
  own: "One object a line: its name, or right ascension and declination (of date; add J2000 for coordinates from a catalogue).", kinds: "Which objects", rates: "Rate of tracking", spiral: "Search in a spiral", pin: "Pin of the console",
};
/** Choices: values and words; the keys and what they do; what a tap is. */
export const CHOICES = {
  tracking: [["on", "On"], ["off", "Off"]],
  rates: [["sidereal", "Stars"], ["lunar", "Moon"], ["solar", "Sun"]],
  steps: [["hold", "Move"], ["pulse", "Pulse"], ["1", "1′"], ["5", "5′"], ["field", "Field"]],
  taps: { pulse: "1 s of guiding", 1: "1′", 5: "5′", field: "one field" },
  kinds: [["all", "All"], ["planets", "Planets"], ["galaxies", "Galaxies"], ["nebulae", "Nebulae"], ["clusters", "Clusters"], ["doubles", "Doubles"], ["own", "★ Mine"]],
  light: [["auto", "By the Sun"], ["day", "Day"], ["night", "Red"]],
  brightness: [["-1", "1"], ["0", "2"], ["1", "3"], ["2", "4"], ["3", "5"], ["4", "6"]],
  guides: [["0.25", "¼ ×"], ["0.5", "½ ×"], ["0.75", "¾ ×"], ["1", "1 ×"]],
  shown: [["programs", "Programs"], ["refused", "Refusals"], ["all", "Everything"]],
  up: { north: "N ↑", south: "S ↑", zenith: "Tube ↓" },
  keys: [
    ["Esc", "stops everything, wherever you are"],
    ["Space", "stops everything, except where you type"],
    ["← ↑ → ↓", "move by hand while held, when the pad is chosen (Tab leads there)"],
    ["1 … 9", "the rate of motion by hand"],
    ["Enter", "presses a button"],
  ],
};
/** What stands in index.html, by the selector of its element: text, names for screen readers, what a field shows while it is empty. */
const TEXT = {
  "[data-to=sky]": "Sky", "#sky-title": "Sky", "[data-to=control]": "Control", "#control-title": "Control", "[data-to=readings]": "Readings", "#readings-title": "Readings",
  "[data-to=talk]": "Talk", "#talk-title": "Conversation", "[data-to=more]": "More", "#more-title": "More",
  "[for=object]": "Object, right ascension and declination of date, or altitude and azimuth", "#search [type=submit]": "Find", "[for=command]": "Command to explain",
  "#explain [type=submit]": "Explain",
  "#sky-hint": "Tap a star or an empty place in the sky, or type a name above. Nothing moves before you confirm. The mount may not point into hatched areas.", "#ask-no": "Cancel",
};
const SPOKEN = {
  "#light": "Red light, for the night", ".views": "Views", "#mounts": "Mount that is shown", "#banners": "Notices", "#suggestions": "Suggestions", "#sky": "The sky above the mount",
  "#glance": "Where it points", ".chart-tools": "Chart", "#chart-in": "Larger", "#chart-out": "Smaller", "#place": "Chosen place",
  "#pad": "Move by hand: hold a direction; with the keyboard, hold an arrow key", ".speed": "Rate of motion by hand", "#slower": "Slower", "#rate": "Rate, 1 slowest to 9 fastest",
  "#faster": "Faster", "#steps": "What an arrow does", "#conversation": "What programs and the mount say", "#explain-surface": "Protocol of the command", "#notices": "Answers",
};
const EMPTY = {
  "#object": "M 31, Vega, RA Dec …", "#command": "What does a command do? :GR#",
};

/** Write them into the page. */
export function write() {
  for (const [where, words] of Object.entries(TEXT)) document.querySelector(where).append(words);
  for (const [where, words] of Object.entries(SPOKEN)) document.querySelector(where).setAttribute("aria-label", words);
  for (const [where, words] of Object.entries(EMPTY)) document.querySelector(where).setAttribute("placeholder", words);
}
