// All tests of the page with one browser. Run by tests/page/run.
import { after, before } from "node:test";
import { startBrowser, stopBrowser } from "./browser.js";

before(startBrowser);
after(stopBrowser);
await import("./submit_test.js");
await import("./result_test.js");
await import("./server_test.js");
await import("./access_test.js");
