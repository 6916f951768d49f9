// Requests to the server that this page came from.

/** The server refused: an RFC 9457 problem document. */
export class Problem extends Error {
    constructor(status, document) {
        super(document.detail || document.title || `status ${status}`);
        this.status = status;
        /** [{pointer, detail}]: JSON pointers into the request. */
        this.errors = document.errors ?? [];
    }
}

/** No answer: the server is down, or the network to it. */
export class Unreachable extends Error {}

const tokenKey = "gonio token";
let askForToken = null;

/** `ask(refused)` returns a promise of the token that a person gives; `refused`: the last one was wrong. */
export function onTokenNeeded(ask) {
    askForToken = ask;
}

let asking = null;

async function newToken(refused) {
    // One question, however many requests wait for its answer.
    asking ??= askForToken(refused !== null).then((token) => {
        sessionStorage.setItem(tokenKey, token);
        asking = null;
    });
    await asking;
}

/** fetch() with the token, asked for when the server wants one. Throws Problem or Unreachable. */
export async function request(path, options = {}) {
    for (;;) {
        const token = sessionStorage.getItem(tokenKey);
        const headers = { ...options.headers, ...(token && { Authorization: `Bearer ${token}` }) };
        let response;
        try {
            response = await fetch(path, { ...options, headers });
        } catch (error) {
            if (error.name === "AbortError") throw error;
            throw new Unreachable(`no answer from ${location.host}`);
        }
        if (response.ok) return response;
        if (response.status === 401) {
            // Another request may have got a new token in the meantime.
            if (sessionStorage.getItem(tokenKey) === token) await newToken(token);
            continue;
        }
        // The answer to HEAD has no body, and that of a proxy on the way is no JSON.
        throw new Problem(response.status, await response.json().catch(() => ({ detail: response.statusText })));
    }
}

/** The JSON of an answer; Unreachable if it breaks off. */
async function jsonOf(response) {
    try {
        return await response.json();
    } catch (error) {
        if (error.name === "AbortError" || error instanceof SyntaxError) throw error;
        throw new Unreachable(`the answer of ${location.host} broke off`);
    }
}

export async function getJson(path, options) {
    return jsonOf(await request(path, options));
}

/** Whether the server asks for a token: then links need it too, and cannot carry it. */
export function hasToken() {
    return sessionStorage.getItem(tokenKey) !== null;
}

/** Sends inputs to a process; returns its statusInfo. */
export async function execute(process, inputs, headers = {}) {
    const options = {
        method: "POST",
        headers: { "Content-Type": "application/json", ...headers },
        body: JSON.stringify({ inputs }),
    };
    return getJson(`/processes/${process}/execution`, options);
}

export function cancel(job) {
    return request(`/jobs/${job}`, { method: "DELETE" });
}

/** href of a link of statusInfo; undefined if the server has none. */
export function linkOf(info, relation) {
    return info.links?.find((link) => link.rel === relation)?.href;
}

export const isFinished = (info) => !["accepted", "running"].includes(info.status);
