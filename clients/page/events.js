// Server-sent events read with fetch(), because EventSource cannot send a token.
import { isFinished, request, Unreachable } from "./api.js";

/** Splits a text stream into events {id, data}. */
export class EventParser {
    #rest = "";

    /** The events that this piece completes. */
    push(text) {
        const blocks = (this.#rest + text).split("\n\n");
        this.#rest = blocks.pop();
        return blocks.map((block) => {
            const event = { id: "", data: "" };
            for (const line of block.split("\n")) {
                const [, name, value] = /^(\w*): ?(.*)$/.exec(line) ?? [];
                if (name === "id") event.id = value;
                if (name === "data") event.data += value;
            }
            return event;
        }).filter((event) => event.data !== "");
    }
}

const pause = (milliseconds) => new Promise((resolve) => setTimeout(resolve, milliseconds));

/** Calls `onStatus` with each statusInfo of a job until it has finished or `signal` aborts; comes back, with
 *  growing patience, when the connection breaks. Throws Problem if the server refuses. */
export async function followJob(id, onStatus, signal = new AbortController().signal) {
    let lastId = "";
    for (let failures = 0; !signal.aborted; failures++) {
        try {
            const headers = { Accept: "text/event-stream", ...(lastId && { "Last-Event-ID": lastId }) };
            const response = await request(`/jobs/${id}/events`, { headers, signal });
            const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
            const parser = new EventParser();
            for (let piece = await reader.read(); !piece.done; piece = await reader.read()) {
                for (const event of parser.push(piece.value)) {
                    failures = 0;
                    lastId = event.id;
                    const info = JSON.parse(event.data);
                    onStatus(info);
                    if (isFinished(info)) return;
                }
            }
        } catch (error) {
            if (signal.aborted) return;
            // A stream that breaks is a TypeError; 503 says that there are too many.
            if (!(error instanceof Unreachable || error instanceof TypeError || error.status === 503)) throw error;
        }
        await pause(Math.min(30000, 500 * 2 ** failures));
    }
}
