// The job list, kept fresh: asked for again and again, which is also how the page knows that the server is
// there, and followed by events for the jobs that run.
import { getJson, isFinished, Unreachable } from "./api.js";
import { followJob } from "./events.js";

// Previews are jobs too, but nobody wants them listed.
const isListed = (info) => info.processID !== "statistics";
// A browser keeps at most six connections to a server; two are for events.
const mostFollowed = 2;

export class LiveJobs {
    #jobs = new Map();
    #followed = new Set();
    #wake = () => {};
    #asked = false;
    #wanted = 20;
    #more = false;

    /** `onJobs(list, more)`: newest first, whether older ones exist. `onConnection(null)`: all is well;
     *  `onConnection(seconds)`: lost, the next try comes in so many seconds. */
    constructor(onJobs, onConnection) {
        this.onJobs = onJobs;
        this.onConnection = onConnection;
    }

    /** Never returns. */
    async run() {
        for (let failures = 0; ; ) {
            let seconds = 10;
            this.#asked = false;
            try {
                await this.#load();
                if (failures > 0) this.onConnection(null);
                failures = 0;
                if (this.list().some((info) => !isFinished(info))) seconds = 3;
            } catch (error) {
                if (error instanceof Unreachable) {
                    seconds = Math.min(30, 2 ** failures);
                    failures += 1;
                    this.onConnection(seconds);
                } else {
                    console.warn(error);
                }
            }
            // What was wanted while the answer was on its way is not in it.
            if (!this.#asked) await this.#sleep(seconds);
        }
    }

    /** Asks again at once. */
    refresh() {
        this.#asked = true;
        this.#wake();
    }

    showMore() {
        this.#wanted += 50;
        this.refresh();
    }

    list() {
        return [...this.#jobs.values()];
    }

    find(id) {
        return this.#jobs.get(id);
    }

    async #load() {
        const answer = await getJson(`/jobs?limit=${this.#wanted}`);
        this.#more = answer.links.some((link) => link.rel === "next");
        this.#jobs = new Map(answer.jobs.filter(isListed).map((info) => [info.jobID, info]));
        this.onJobs(this.list(), this.#more);
        const running = this.list().filter((info) => !isFinished(info)).reverse();
        running.slice(0, mostFollowed - this.#followed.size).forEach((info) => this.#follow(info.jobID));
    }

    async #follow(id) {
        if (this.#followed.has(id)) return;
        this.#followed.add(id);
        const update = (info) => {
            this.#jobs.set(id, info);
            this.onJobs(this.list(), this.#more);
        };
        await followJob(id, update).catch((error) => console.warn(error));
        this.#followed.delete(id);
        this.refresh();
    }

    #sleep(seconds) {
        return new Promise((resolve) => {
            const timer = setTimeout(resolve, 1000 * seconds);
            this.#wake = () => {
                clearTimeout(timer);
                resolve();
            };
        });
    }
}
