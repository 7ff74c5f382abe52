// @ts-check
/**
 * Asking the server for the view: always for the newest state, and not before the last one has
 * been seen, so that a slider that is dragged shows something on its way.
 */

/** What changes the picture, beside what is told about it. */
const PICTURE = ["scene", "halves", "edits", "camera", "seed", "difference"];
/** How long, in milliseconds, a newer state waits for the picture of the last one. */
const PATIENCE = 400;

export class Asking {
  /**
   * @param {import("./view.js").View} view
   * @param {import("./connection.js").Connection} connection
   * @param {(number: number) => void} asked called when a new picture has been asked for
   */
  constructor(view, connection, asked) {
    this.view = view;
    this.connection = connection;
    this.asked = asked;
    this.number = 0;
    /** States by the numbers of their messages, until they are answered. */
    this.sent = new Map();
    /** The last state that the server has taken. */
    this.accepted = null;
    this.last = null;
    this.scheduled = false;
    /** The halves of which no picture has come since it was asked for, and when that was. */
    this.unseen = new Set();
    this.askedAt = 0;
    view.onChange(() => this.schedule());
  }

  /** Ask again for everything, after a new connection. */
  again() {
    this.last = null;
    this.sent.clear();
    this.unseen.clear();
    this.schedule();
  }

  /** A picture of a half has come. */
  arrived({ half, number }) {
    if (number >= this.number) this.unseen.delete(half);
  }

  get #waits() {
    const late = performance.now() > this.askedAt + PATIENCE;
    return this.connection.isBusy || (this.unseen.size > 0 && !late);
  }

  /** Ask for what is new in the next animation frame. */
  schedule() {
    const nothingNew = this.view.state === this.last;
    if (this.scheduled || nothingNew || !this.connection.isOpen) return;
    this.scheduled = true;
    requestAnimationFrame(() => {
      this.scheduled = false;
      if (this.#waits) this.schedule();
      else this.#ask();
    });
  }

  /** Have all samples taken anew. */
  restart() {
    this.connection.send({ type: "restart", number: ++this.number });
    this.asked(this.number);
  }

  /** The server shows the view of a number. */
  accept(number) {
    this.accepted = this.#answered(number) ?? this.accepted;
  }

  /** The server has refused a view: return the state to go back to, if nothing newer is asked. */
  refuse(number) {
    this.#answered(number);
    this.unseen.clear();
    if (this.sent.size || this.view.state !== this.last) return null;
    this.last = this.accepted;
    return this.accepted;
  }

  /** The state that an answer is about; those before it were never looked at. */
  #answered(number) {
    const numbers = [...this.sent.keys()].filter((sent) => sent <= number);
    const state = this.sent.get(numbers.at(-1));
    for (const old of numbers) this.sent.delete(old);
    return state;
  }

  #ask() {
    const { state } = this.view;
    const before = this.last;
    this.last = state;
    this.sent.set(++this.number, state);
    this.connection.send({ type: "view", number: this.number, state });
    const text = (of) => JSON.stringify(PICTURE.map((key) => of[key]));
    if (before && text(before) === text(state)) return;
    this.unseen = new Set(state.halves.keys());
    this.askedAt = performance.now();
    this.asked(this.number);
  }
}
