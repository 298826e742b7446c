// Prints what the Khronos validator says about each glTF file named on the command line.
const fs = require("node:fs");
const validator = require("gltf-validator");

async function main() {
  const reports = [];
  for (const path of process.argv.slice(2)) {
    const { issues, info } = await validator.validateBytes(new Uint8Array(fs.readFileSync(path)));
    reports.push({ issues, info });
  }
  console.log(JSON.stringify(reports));
}

main();
