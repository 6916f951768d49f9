// Height maps go to the server once, named by their content.
import { Problem, request } from "./api.js";
import { sha256 } from "./sha256.js";

/** Uploads a File unless the server has it; returns the SHA-256 of its bytes. */
export async function upload(file) {
    const content = new Uint8Array(await file.arrayBuffer());
    const name = await sha256(content);
    try {
        await request(`/surfaces/${name}`, { method: "HEAD" });
    } catch (error) {
        if (!(error instanceof Problem && error.status === 404)) throw error;
        await request(`/surfaces/${name}`, { method: "PUT", body: content });
    }
    return name;
}
