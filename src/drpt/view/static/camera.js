// @ts-check
/** The camera by mouse: drag to orbit, wheel to zoom. */

const DEGREES_PER_PIXEL = 0.4;
const STOPS_PER_PIXEL = 1 / 400;
const HIGHEST = 89;
const RIGHT_BUTTON = 2;

/**
 * Let drags and the wheel on an element move a view's camera.
 * @param {HTMLElement} element
 * @param {import("./view.js").View} view
 * @returns {() => boolean} whether the last press was for the camera, and its click is for nothing
 */
export function addOrbit(element, view) {
  let orbiting = false;
  element.addEventListener("contextmenu", (event) => event.preventDefault());
  element.addEventListener("pointerdown", (event) => {
    orbiting = orbits(event);
    if (!orbiting) return;
    event.preventDefault();
    element.focus();
    element.setPointerCapture(event.pointerId);
    follow(element, view, event);
  });
  element.addEventListener("wheel", (event) => wheel(element, view, event), { passive: false });
  return () => orbiting;
}

/** Whether a button of the mouse means the camera. */
function orbits({ button, altKey }) {
  return button === RIGHT_BUTTON || altKey;
}

/** Turn the camera with the pointer until its button is let go. */
function follow(element, view, { clientX, clientY }) {
  const { azimuth, elevation } = view.state.camera;
  const stop = new AbortController();
  const { signal } = stop;
  const move = (event) => {
    const turn = (event.clientX - clientX) * DEGREES_PER_PIXEL;
    const rise = elevation + (event.clientY - clientY) * DEGREES_PER_PIXEL;
    view.move({
      azimuth: tenth(((azimuth - turn + 540) % 360) - 180),
      elevation: tenth(Math.min(Math.max(rise, -HIGHEST), HIGHEST)),
    });
  };
  element.addEventListener("pointermove", move, { signal });
  for (const end of ["pointerup", "pointercancel"]) {
    element.addEventListener(end, () => stop.abort(), { signal });
  }
}

function tenth(value) {
  return Math.round(10 * value) / 10;
}

/** Zoom, unless the wheel means the browser's zoom or a page that scrolls under the picture. */
function wheel(element, view, event) {
  const { scrollHeight, clientHeight } = document.documentElement;
  const scrolls = scrollHeight > clientHeight && document.activeElement !== element;
  if (event.ctrlKey || scrolls) return;
  event.preventDefault();
  const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 16 : 1;
  view.zoomBy(-event.deltaY * lines * STOPS_PER_PIXEL);
}
