// @ts-check
/** The connection to the server, which is made again by itself when it is lost. */

const FIRST_WAIT = 0.25;
const LONGEST_WAIT = 4;
const BUSY_WAIT = 10;
const POLICY_VIOLATION = 1008;
const TRY_AGAIN_LATER = 1013;

/**
 * @typedef {object} Handlers
 * @property {(message: any) => void} message takes a message of text
 * @property {(header: any, buffer: ArrayBuffer, start: number) => void} binary takes another one,
 *   whose payload begins at `start`
 * @property {(state: "connecting" | "open" | "lost" | "refused", text: string) => void} status
 */

export class Connection {
  /** @param {Handlers} handlers */
  constructor(handlers) {
    this.handlers = handlers;
    this.wait = FIRST_WAIT;
    this.#open();
  }

  get isOpen() {
    return this.socket?.readyState === WebSocket.OPEN;
  }

  /** Whether messages still wait to leave. */
  get isBusy() {
    return (this.socket?.bufferedAmount ?? 0) > 0;
  }

  /** Send a message; without a connection it is lost. */
  send(message) {
    if (this.isOpen) this.socket?.send(JSON.stringify(message));
  }

  #open() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const token = new URLSearchParams(location.search).get("token");
    const query = token === null ? "" : `?${new URLSearchParams({ token })}`;
    this.socket = new WebSocket(`${scheme}://${location.host}/ws${query}`);
    this.socket.binaryType = "arraybuffer";
    this.socket.addEventListener("message", ({ data }) => this.#receive(data));
    this.socket.addEventListener("close", (event) => this.#closed(event));
  }

  #receive(data) {
    if (data instanceof ArrayBuffer) {
      const start = 4 + new DataView(data).getUint32(0, true);
      const header = new TextDecoder().decode(new Uint8Array(data, 4, start - 4));
      this.handlers.binary(JSON.parse(header), data, start);
      return;
    }
    const message = JSON.parse(data);
    if (message.type === "hello") {
      this.wait = FIRST_WAIT;
      this.handlers.status("open", "connected");
    }
    this.handlers.message(message);
  }

  #closed({ code, reason }) {
    if (code === POLICY_VIOLATION) {
      this.handlers.status("refused", `refused: ${reason}; reload the page to try again`);
      return;
    }
    const busy = code === TRY_AGAIN_LATER;
    const text = busy ? `${reason}; trying again` : "server gone, trying again";
    this.handlers.status("lost", text);
    setTimeout(() => this.#open(), 1000 * (busy ? BUSY_WAIT : this.wait));
    this.wait = Math.min(2 * this.wait, LONGEST_WAIT);
  }
}
