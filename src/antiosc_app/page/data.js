// The data of the page: JSON, its arrays in base64.

const ARRAYS = { f8: Float64Array, f4: Float32Array, i2: Int16Array, u4: Uint32Array, u1: Uint8Array };

function unpacked(text) {
  return JSON.parse(text, (_, value) => {
    if (value === null || typeof value !== "object" || !value.$) return value;
    const bytes = atob(value.of), read = new Uint8Array(bytes.length);
    for (let i = 0; i < bytes.length; i++) read[i] = bytes.charCodeAt(i);
    return new ARRAYS[value.$](read.buffer);
  });
}
