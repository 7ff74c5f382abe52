// @ts-check
/** The divider between the halves: by mouse, touch or keys. */

const STEP = 0.01;
const KEYS = {
  ArrowLeft: -STEP,
  ArrowRight: STEP,
  ArrowDown: -STEP,
  ArrowUp: STEP,
  PageDown: -10 * STEP,
  PageUp: 10 * STEP,
};

/**
 * Let a divider follow a view, and move it.
 * @param {HTMLElement} element inside of the picture
 * @param {import("./view.js").View} view
 */
export function addDivider(element, view) {
  const picture = /** @type {HTMLElement} */ (element.parentElement);
  const move = (place) => view.show({ divider: Math.min(Math.max(place, 0), 1) });
  element.addEventListener("pointerdown", (event) => {
    event.stopPropagation();
    element.setPointerCapture(event.pointerId);
  });
  element.addEventListener("pointermove", (event) => {
    if (!element.hasPointerCapture(event.pointerId)) return;
    const { left, width } = picture.getBoundingClientRect();
    move(Math.round((1000 * (event.clientX - left)) / width) / 1000);
  });
  element.addEventListener("click", (event) => event.stopPropagation());
  element.addEventListener("keydown", (event) => {
    const ends = { Home: 0, End: 1 };
    const place = ends[event.key] ?? view.look.divider + KEYS[event.key];
    if (Number.isNaN(place)) return;
    event.preventDefault();
    event.stopPropagation();
    move(Math.round(1000 * place) / 1000);
  });
  view.onChange(() => {
    element.hidden = view.state.halves.length < 2;
    element.style.left = `${100 * view.look.divider}%`;
    element.setAttribute("aria-valuenow", String(Math.round(100 * view.look.divider)));
  });
}
