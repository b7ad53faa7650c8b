// The page of a report: its data lie in it.

const content = unpacked(find("data").textContent), view_of_report = View.on(find("view"));
if (content.fall) globalThis.page = new FallPage(content.fall, view_of_report);
else Engine.load(content.engine).then((engine) => { globalThis.page = new Page(content, engine, view_of_report); });
