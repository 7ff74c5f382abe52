// @ts-check
/** The word that a new picture is on its way, where it takes long. */

const PATIENCE = 500;

export class Busy {
  /** @param {HTMLElement} element */
  constructor(element) {
    this.element = element;
    this.number = 0;
    this.timer = 0;
  }

  /** A picture has been asked for. */
  wait(number) {
    this.number = number;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => (this.element.textContent = "compiling…"), PATIENCE);
  }

  /** A picture has come. */
  arrived(number) {
    if (number >= this.number) this.end();
  }

  /** Nothing is waited for. */
  end() {
    clearTimeout(this.timer);
    this.element.textContent = "";
  }
}
