#!/usr/bin/env node
// SPDX-License-Identifier: Apache-2.0
//
// Parquet files by three writers that know nothing of each other, all of one made-up table, and its numbers as
// expected.json: node write_parquet.js DATA
//
// Needs node 20 and, from npm (NODE_PATH tells where, if not beside this file): @duckdb/node-api 1.5.6,
// parquet-wasm 0.8.0 (arrow-rs), apache-arrow 21, hyparquet-writer 0.17.
const fs = require("node:fs");
const path = require("node:path");
const zlib = require("node:zlib");
const arrow = require("apache-arrow");
const wasm = require("parquet-wasm/node");
const { DuckDBInstance } = require("@duckdb/node-api");

const data = process.argv[2];
const kRows = 60;

// ---- the table: columns as a LeRobot dataset has them, and some with holes ----

const row = (i) => ({
  "observation.state": [0, 1, 2].map((j) => Math.fround(Math.sin(0.1 * i + j))),
  "action": [0, 1, 2].map((j) => Math.fround(Math.sin(0.1 * (i + 1) + j))),
  "timestamp": Math.fround((i % 30) / 30),
  "frame_index": i % 30,
  "episode_index": Math.floor(i / 30),
  "small": (i * i) % 97 - 40,
  "effort": i % 7 === 3 ? null : Math.cos(i) / 3,
  "done": i % 30 === 29,
  "task": i < 30 ? "pick the cube" : "stöpsel",
  // A list that is not there, one without elements, one with a hole.
  "holes": i % 5 === 1 ? null : i % 5 === 2 ? [] : i % 5 === 3 ? [i, null] : [i + 0.5],
});
const rows = Array.from({ length: kRows }, (_, i) => row(i));
const column = (name) => rows.map((r) => r[name]);
const names = Object.keys(rows[0]);
fs.writeFileSync(path.join(data, "expected.json"),
  JSON.stringify(Object.fromEntries(names.map((n) => [n, column(n)]))) + "\n");

// ---- DuckDB ----

async function with_duckdb() {
  const connection = await (await DuckDBInstance.create(":memory:")).connect();
  const source = path.join(data, "expected.json");
  const lists = ["observation.state", "action"].map((n) => `unnest("${n}")::FLOAT[] AS "${n}"`);
  await connection.run(`CREATE TABLE t AS SELECT ${lists.join(", ")}, unnest(timestamp)::FLOAT AS timestamp,
    unnest(frame_index)::BIGINT AS frame_index, unnest(episode_index)::BIGINT AS episode_index,
    unnest(small)::INTEGER AS small, unnest(effort)::DOUBLE AS effort, unnest(done)::BOOLEAN AS done,
    unnest(task)::VARCHAR AS task, unnest(holes)::DOUBLE[] AS holes
    FROM read_json('${source}', maximum_object_size = 10000000)`);
  const write = (name, options) => connection.run(`COPY t TO '${path.join(data, name)}' (FORMAT parquet, ${options})`);
  await write("duckdb_snappy.parquet", "COMPRESSION snappy");
  await write("duckdb_gzip.parquet", "COMPRESSION gzip");
  await write("duckdb_v2_zstd.parquet", "COMPRESSION zstd, PARQUET_VERSION v2");
  await write("duckdb_v2_plain.parquet", "COMPRESSION uncompressed, PARQUET_VERSION v2, DICTIONARY_SIZE_LIMIT 1");
  await write("duckdb_brotli.parquet", "COMPRESSION brotli");
}

// ---- arrow-rs ----

function with_arrow_rs() {
  const list = (type) => new arrow.List(new arrow.Field("element", type, true));
  const types = {
    "observation.state": list(new arrow.Float32()), "action": list(new arrow.Float32()),
    "timestamp": new arrow.Float32(), "frame_index": new arrow.Int64(), "episode_index": new arrow.Int64(),
    "small": new arrow.Int32(), "effort": new arrow.Float64(), "done": new arrow.Bool(), "task": new arrow.Utf8(),
    "holes": list(new arrow.Float64()),
  };
  const big = (name, values) => types[name] instanceof arrow.Int64 ? values.map(BigInt) : values;
  const table = new arrow.Table(Object.fromEntries(
    names.map((n) => [n, arrow.vectorFromArray(big(n, column(n)), types[n])])));
  const write = (name, change) => {
    const properties = change(new wasm.WriterPropertiesBuilder()).build();
    const stream = wasm.Table.fromIPCStream(arrow.tableToIPC(table, "stream"));
    fs.writeFileSync(path.join(data, name), wasm.writeParquet(stream, properties));
  };
  const { Compression, Encoding, WriterVersion } = wasm;
  write("arrow_rs_snappy.parquet", (p) => p.setCompression(Compression.SNAPPY).setMaxRowGroupSize(25)
    .setDataPageSizeLimit(64).setWriteBatchSize(8));
  write("arrow_rs_v2_zstd.parquet", (p) => p.setCompression(Compression.ZSTD).setMaxRowGroupSize(25)
    .setWriterVersion(WriterVersion.V2).setDataPageSizeLimit(64).setWriteBatchSize(8));
  write("arrow_rs_v2_delta.parquet", (p) => p.setCompression(Compression.UNCOMPRESSED).setDictionaryEnabled(false)
    .setWriterVersion(WriterVersion.V2).setColumnEncoding("task", Encoding.DELTA_LENGTH_BYTE_ARRAY));
  write("arrow_rs_delta_bytes.parquet", (p) => p.setCompression(Compression.UNCOMPRESSED)
    .setDictionaryEnabled(false).setEncoding(Encoding.PLAIN).setColumnEncoding("task", Encoding.DELTA_BYTE_ARRAY));
}

// ---- hyparquet-writer ----

async function with_hyparquet() {
  const { parquetWriteBuffer } = await import(require.resolve("hyparquet-writer"));
  const leaf = { FLOAT: "FLOAT", DOUBLE: "DOUBLE" };
  const types = { "timestamp": "FLOAT", "frame_index": "INT64", "episode_index": "INT64", "small": "INT32",
    "effort": "DOUBLE", "done": "BOOLEAN", "task": "STRING" };
  const list = (name, type) => [
    { name, repetition_type: "OPTIONAL", num_children: 1, converted_type: "LIST" },
    { name: "list", repetition_type: "REPEATED", num_children: 1 },
    { name: "element", type: leaf[type], repetition_type: "OPTIONAL" }];
  const basic = { STRING: { type: "BYTE_ARRAY", converted_type: "UTF8" } };
  const schema = [{ name: "root", num_children: names.length }];
  for (const name of names) {
    if (name === "observation.state" || name === "action") schema.push(...list(name, "FLOAT"));
    else if (name === "holes") schema.push(...list(name, "DOUBLE"));
    else schema.push({ name, repetition_type: name === "effort" ? "OPTIONAL" : "REQUIRED",
      ...(basic[types[name]] ?? { type: types[name] }) });
  }
  const ints = ["frame_index", "episode_index"];
  const columnData = (encodings) => names.map((name) => ({ name, encoding: encodings[name],
    data: ints.includes(name) ? column(name).map(BigInt) : column(name) }));
  const write = (name, encodings, options) => fs.writeFileSync(path.join(data, name), Buffer.from(
    parquetWriteBuffer({ columnData: columnData(encodings), schema, ...options })));
  write("hyparquet_snappy.parquet", {}, { rowGroupSize: 40 });
  write("hyparquet_encodings.parquet", { "frame_index": "DELTA_BINARY_PACKED", "small": "DELTA_BINARY_PACKED",
    "timestamp": "BYTE_STREAM_SPLIT", "done": "RLE", "task": "DELTA_LENGTH_BYTE_ARRAY" },
    { codec: "GZIP", compressors: { GZIP: (bytes) => zlib.gzipSync(bytes) } });
}

(async () => {
  await with_duckdb();
  with_arrow_rs();
  await with_hyparquet();
})();
