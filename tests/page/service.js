// A real `gonio serve` in a folder of its own, and its API as the tests need it.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { createHash } from "node:crypto";
import { rmSync } from "node:fs";
import { chmod, mkdtemp, rm, writeFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { once } from "node:events";
import { createInterface } from "node:readline";

const { GONIO } = process.env;

// No server and no folder outlives the tests, however they end.
const running = new Set();
process.on("exit", () => running.forEach((service) => {
    service.process.kill("SIGKILL");
    rmSync(service.folder, { recursive: true, force: true });
}));
process.once("SIGTERM", () => process.exit(1));

export class Service {
    /** `tokens`: lines of a token file; none is wanted without. */
    static async start(tokens) {
        const service = new Service();
        service.folder = await mkdtemp(join(tmpdir(), "gonio_page_"));
        service.options = [];
        if (tokens) {
            const file = join(service.folder, "tokens");
            await writeFile(file, tokens, { mode: 0o600 });
            await chmod(file, 0o600);
            service.options = ["--token-file", file];
        }
        await service.launch("127.0.0.1:0");
        return service;
    }

    async launch(address) {
        this.process = spawn(GONIO, ["serve", "--data", join(this.folder, "data"), "--listen", address, "--threads", "1", ...this.options],
            { stdio: ["ignore", "pipe", "inherit"] });
        running.add(this);
        const [line] = await once(createInterface(this.process.stdout), "line");
        this.url = /^listening on (http:\S+)$/.exec(line)[1];
    }

    async kill() {
        if (this.process.exitCode !== null || this.process.signalCode !== null) return;
        const ended = once(this.process, "exit");
        this.process.kill("SIGKILL");
        await ended;
    }

    /** After kill(): the same data at the same address. */
    restart() {
        return this.launch(new URL(this.url).host);
    }

    async stop() {
        await this.kill();
        running.delete(this);
        await rm(this.folder, { recursive: true });
    }

    async json(path, options) {
        const response = await fetch(this.url + path, options);
        const body = await response.json();
        assert.ok(response.ok, `${path}: ${JSON.stringify(body)}`);
        return body;
    }

    submit(inputs) {
        return this.json("/processes/brdf/execution", { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify({ inputs }) });
    }

    /** Submits and waits for the end. */
    async finish(inputs) {
        let info = await this.submit(inputs);
        while (["accepted", "running"].includes(info.status)) {
            await new Promise((resolve) => setTimeout(resolve, 50));
            info = await this.json(`/jobs/${info.jobID}`);
        }
        assert.equal(info.status, "successful", info.message);
        return info;
    }

    table(job) {
        return this.json(`/jobs/${job}/results/table?f=json`);
    }
}

export const sha256 = (bytes) => createHash("sha256").update(bytes).digest("hex");

const groove = { generate: "v_groove", samples: 16, period: "1 mm", slope_deg: 45 };
const steps = (from, to, step) => Array.from({ length: Math.floor((to - from) / step) + 1 }, (_, k) => from + k * step);
const grid = { theta_deg: steps(0, 80, 10), phi_deg: steps(0, 330, 30) };
const brdf = { kind: "brdf", incident: { theta_deg: [0, 30, 60], phi_deg: [0, 90] }, outgoing: grid };

/** Every view has something to show: colours, orders, two azimuths. */
export const richJob = {
    surface: groove, material: { model: "lambertian", albedo: [0.8, 0.5, 0.2] },
    measure: { ...brdf, max_order: 3, orders: "separate" }, accuracy: { target_relative_error: 0.05 },
};
/** f = albedo / pi everywhere, exactly. */
export const planeJob = (albedo) => ({
    surface: { generate: "plane", samples: 4, pitch: "1 mm" }, material: { model: "lambertian", albedo }, measure: brdf,
});
/** Far more runs than any test waits for, each of them short. */
export const longJob = {
    surface: { generate: "gaussian", samples: 64, pitch: "1 um", correlation_length: "3 um", rms_slope: 1 },
    material: { model: "lambertian", albedo: 0.8 }, measure: brdf, accuracy: { target_relative_error: 1e-6 },
};
