// The page of a report: its data lie in it.

const content = unpacked(find("data").textContent);
Engine.load(content.engine).then((engine) => { globalThis.page = new Page(content, engine, View.on(find("view"))); });
