// Debian's Chromium, and pages that fail their test when they complain.
import assert from "node:assert/strict";
import { mkdir } from "node:fs/promises";
import { join } from "node:path";
import axe from "axe-core";
import { chromium } from "playwright-core";

const { SCREENSHOTS } = process.env;
let browser;

export async function startBrowser() {
    await mkdir(SCREENSHOTS, { recursive: true });
    // WebGL in software: the machines that test have no graphics card.
    browser = await chromium.launch({
        executablePath: "/usr/bin/chromium",
        args: ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
    });
}

export function stopBrowser() {
    return browser?.close();
}

/** Runs `action(page)` on a page at `url`; no message of the console but those that match one of `allowed` may come. */
export async function withPage(url, action, { allowed = [], prepare = () => {}, ...options } = {}) {
    const context = await browser.newContext({ viewport: { width: 1280, height: 900 }, reducedMotion: "reduce", ...options });
    context.setDefaultTimeout(120000);
    const complaints = [];
    try {
        const page = await context.newPage();
        // Violations of the content security policy are errors of the console, too.
        page.on("console", (message) => ["error", "warning"].includes(message.type()) && complaints.push(`${message.text()} ${message.location().url}`));
        page.on("pageerror", (error) => complaints.push(error.stack));
        await prepare(page);
        await page.goto(url);
        await action(page);
        assert.deepEqual(complaints.filter((text) => !allowed.some((pattern) => pattern.test(text))), []);
    } finally {
        await context.close();
    }
}

export function screenshot(page, name) {
    return page.screenshot({ path: join(SCREENSHOTS, `${name}.png`), fullPage: true });
}

/** Nothing sticks out to the right, and axe finds nothing serious. */
export async function assertAccessible(page) {
    const [content, window] = await page.evaluate(() => [document.documentElement.scrollWidth, innerWidth]);
    assert.ok(content <= window, `content of ${content} px in a window of ${window} px`);
    await page.evaluate(axe.source);
    const { violations, passes } = await page.evaluate(() => window.axe.run());
    assert.ok(passes.length > 10, "axe has looked at the page");
    const serious = violations.filter(({ impact }) => ["serious", "critical"].includes(impact));
    assert.deepEqual(serious.map(({ id, nodes }) => `${id}: ${nodes.map((node) => node.html).join("  ")}`), []);
}

/** Mean brightness (0 to 255) of the left and the right half of an element as it is on the screen. */
export async function brightness(page, locator) {
    const picture = (await locator.screenshot()).toString("base64");
    return page.evaluate(async (content) => {
        const image = new Image();
        image.src = `data:image/png;base64,${content}`;
        await image.decode();
        const canvas = document.createElement("canvas");
        [canvas.width, canvas.height] = [image.width, image.height];
        const context = canvas.getContext("2d", { willReadFrequently: true });
        context.drawImage(image, 0, 0);
        const middle = Math.floor(image.width / 2);
        const mean = (from, width) => {
            const { data } = context.getImageData(from, 0, width, image.height);
            let sum = 0;
            for (let k = 0; k < data.length; k += 4) sum += data[k] + data[k + 1] + data[k + 2];
            return (4 * sum) / (3 * data.length);
        };
        return [mean(0, middle), mean(middle, middle)];
    }, picture);
}
