#!/usr/bin/env node
// SPDX-License-Identifier: Apache-2.0
//
// The MCAP bags, sound and damaged, from WORK/content.json (content.py): node write_mcap.js WORK DATA
// Also writes WORK/cdr.json, the messages as CDR for write_rosbag2.py, and adds what is readable in front of each
// damage to DATA/damaged.json.
//
// Needs node 20 and, from npm (NODE_PATH tells where, if not beside this file): @mcap/core 2.2.2, @foxglove/cdr 3.5.0,
// @foxglove/rosmsg 5.0.5, @foxglove/rosmsg2-serialization 3.1.0, @foxglove/rosmsg-msgs-common 3.2.3,
// @foxglove/wasm-zstd 1.0.1; the programs lz4 1.9.4 and zstd 1.5.4.
const { spawnSync } = require("node:child_process");
const fs = require("node:fs");
const path = require("node:path");
const { CdrWriter, EncapsulationKind } = require("@foxglove/cdr");
const { parse } = require("@foxglove/rosmsg");
const { MessageWriter } = require("@foxglove/rosmsg2-serialization");
const zstd = require("@foxglove/wasm-zstd");
const { McapIndexedReader, McapWriter, TempBuffer } = require("@mcap/core");

const [work, data] = process.argv.slice(2);
const content = JSON.parse(fs.readFileSync(path.join(work, "content.json")));
for (const { topic, value } of content.messages) {
  if (["/camera/image_raw", "/camera/compressed"].includes(topic)) {
    value.data = Buffer.from(value.data, "base64");
  }
}

// ---- message definitions ----

const common = path.dirname(require.resolve("@foxglove/rosmsg-msgs-common/package.json"));
const definitions = path.join(common, "msgdefs", "ros2jazzy");
const apriltag = {
  "apriltag_msgs/AprilTagDetectionArray": "std_msgs/Header header\nAprilTagDetection[] detections\n",
  "apriltag_msgs/AprilTagDetection":
    "string family\nint32 id\nint32 hamming\nfloat32 goodness\nfloat32 decision_margin\n" +
    "Point centre                    # centre in (x,y) pixel coordinates\n" +
    "Point[4] corners                # corners of tag ((x1,y1),(x2,y2),...)\n" +
    "float64[9] homography           # 3x3 row-major homography matrix",
  "apriltag_msgs/Point": "float64 x\nfloat64 y\n",
};
const line = "=".repeat(80);
const primitive = /^(bool|byte|char|w?string|u?int(8|16|32|64)|float(32|64))$/;

function ownText(type) {
  const file = path.join(definitions, path.dirname(type), "msg", `${path.basename(type)}.msg`);
  return apriltag[type] ?? fs.readFileSync(file, "utf8").split(`\n${line}`)[0].trimEnd() + "\n";
}

function withoutComments(text) {
  return text.split("\n").map((l) => l.replace(/\s*#.*/, "")).filter((l) => l !== "").join("\n") + "\n";
}

/** The definition of a type and, depth first, of those it is made of, as rosbag2 joins them. */
function schemaText(fullName, comments) {
  const seen = new Set();
  const append = (type) => {
    seen.add(type);
    const fields = withoutComments(ownText(type)).split("\n").filter((l) => l !== "" && !l.includes("="));
    const parts = fields.map((l) => l.match(/^[\w/]+/)[0]).filter((t) => !primitive.test(t));
    const names = parts.map((t) => (t.includes("/") ? t : `${type.split("/")[0]}/${t}`)).sort();
    let text = comments ? ownText(type) : withoutComments(ownText(type));
    for (const name of names) {
      if (!seen.has(name)) {
        text += `\n${line}\nMSG: ${name}\n${append(name)}`;
      }
    }
    return text;
  };
  return append(fullName.replace("/msg/", "/"));
}

// ---- CDR ----

const writers = {};
for (const type of Object.values(content.types)) {
  writers[type] ??= new MessageWriter(parse(schemaText(type, true), { ros2: true }));
}
for (const message of content.messages) {
  message.cdr = writers[content.types[message.topic]].writeMessage(message.value);
}

/** A JointState in big-endian CDR; count overrides the declared length of name. */
function jointState(value, kind, count) {
  const cdr = new CdrWriter({ kind });
  cdr.int32(value.header.stamp.sec).uint32(value.header.stamp.nanosec).string(value.header.frame_id);
  cdr.uint32(count ?? value.name.length);
  value.name.forEach((name) => cdr.string(name));
  for (const values of [value.position, value.velocity, value.effort]) {
    cdr.float64Array(values, true);
  }
  return cdr.data;
}

// ---- files ----

const forever = "    sec: 9223372036\n    nsec: 854775807\n";
const qos =
  `- history: 3\n  depth: 0\n  reliability: 1\n  durability: 2\n  deadline:\n${forever}  lifespan:\n${forever}` +
  `  liveliness: 1\n  liveliness_lease_duration:\n${forever}  avoid_ros_namespace_conventions: false`;

async function bag(messages, { comments = false, extras = false, ...options } = {}) {
  const buffer = new TempBuffer();
  const writer = new McapWriter({ writable: buffer, chunkSize: 5000, ...options });
  await writer.start({ profile: "ros2", library: "@mcap/core 2.2.2" });
  if (extras) {
    await writer.addMetadata({ name: "rosbag2", metadata: new Map([["ROS_DISTRO", "jazzy"]]) });
    await writer.addAttachment({ name: "notes.txt", mediaType: "text/plain", logTime: 0n, createTime: 0n,
                                 data: new TextEncoder().encode("left joint stiff") });
  }
  const schemas = new Map(), channels = new Map();
  for (const topic of Object.keys(content.types).filter((t) => messages.some((m) => m.topic === t))) {
    const name = content.types[topic];
    if (!schemas.has(name)) {
      const text = new TextEncoder().encode(schemaText(name, comments));
      schemas.set(name, await writer.registerSchema({ name, encoding: "ros2msg", data: text }));
    }
    const metadata = new Map([["offered_qos_profiles", comments && topic === "/joint_states" ? qos : ""]]);
    const channel = { topic, schemaId: schemas.get(name), messageEncoding: "cdr", metadata };
    channels.set(topic, await writer.registerChannel(channel));
  }
  const sequences = new Map();
  for (const { topic, stamp_ns, receive_ns, cdr } of messages) {
    sequences.set(topic, (sequences.get(topic) ?? 0) + 1);
    await writer.addMessage({ channelId: channels.get(topic), sequence: sequences.get(topic), data: cdr,
                              logTime: BigInt(receive_ns), publishTime: BigInt(stamp_ns) + 1_000_000n });
  }
  await writer.end();
  return Buffer.from(buffer.get());
}

function program(...command) {
  const { status, stdout } = spawnSync(command[0], command.slice(1), { input: program.input, maxBuffer: 1 << 20 });
  if (status !== 0) {
    throw new Error(`${command[0]} failed`);
  }
  return stdout;
}

const pipe = (compression, ...command) => (chunk) => {
  program.input = chunk;
  return { compression, compressedData: program(...command) };
};

const damaged = {};
function write(name, bytes, readable) {
  fs.mkdirSync(path.dirname(path.join(data, name)), { recursive: true });
  fs.writeFileSync(path.join(data, name), bytes);
  if (readable) {
    damaged[name] = readable;
  }
}

/** Chunks of a bag: the start and size of each's (compressed) records, and how many /joint_states it holds. */
async function chunks(bytes) {
  const readable = { size: async () => BigInt(bytes.length),
                     read: async (at, size) => new Uint8Array(bytes.subarray(Number(at), Number(at + size))) };
  const reader = await McapIndexedReader.Initialize({ readable });
  return reader.chunkIndexes.map((c) => {
    const inside = ({ topic, receive_ns: t }) =>
      topic === "/joint_states" && BigInt(t) >= c.messageStartTime && BigInt(t) <= c.messageEndTime;
    return { start: Number(c.chunkStartOffset) + 9 + 40 + c.compression.length, size: Number(c.compressedSize),
             joint_states: content.messages.filter(inside).length };
  });
}

async function main() {
  await zstd.isLoaded;
  const all = content.messages;
  const joints = all.filter((m) => m.topic.endsWith("joint_states"));
  const first = joints.filter((m) => m.topic === "/joint_states").slice(0, 8);
  const compressChunk = (c) => ({ compression: "zstd", compressedData: zstd.compress(c, 9) });
  const lz4 = pipe("lz4", "lz4", "-c", "-9", "-");
  // Most summaries leave the schemas out, which keeps the files small.
  write("joints_none.mcap", await bag(all, { chunkSize: 8000 }));
  write("joints_zstd.mcap", await bag(all, { repeatSchemas: false, compressChunk }));
  write("joints_lz4.mcap", await bag(all, { repeatSchemas: false, compressChunk: lz4 }));
  write("joints_unchunked.mcap", await bag(all, { useChunks: false, repeatSchemas: false, repeatChannels: false }));
  write("joints_no_index.mcap", await bag(all, {
    compressChunk, repeatSchemas: false, repeatChannels: false, useStatistics: false, useSummaryOffsets: false,
    useMessageIndex: false, useChunkIndex: false, useAttachmentIndex: false, useMetadataIndex: false,
  }));
  // Streamed zstd frames, which do not tell the size of what they hold.
  write("joints_mcap_folder/joints_mcap_folder_0.mcap", await bag(all, {
    comments: true, extras: true, repeatSchemas: false, chunkSize: 12000,
    compressChunk: pipe("zstd", "zstd", "-c", "-19"),
  }));
  const big = joints.map((m) => ({ ...m, cdr: jointState(m.value, EncapsulationKind.CDR_BE) }));
  write("joints_xcdr_be.mcap", await bag(big, { repeatSchemas: false }));

  // Damaged ones.
  const packed = await bag(all, { chunkSize: 3000, compressChunk });
  const cut = await chunks(packed);
  const inFront = cut.slice(0, 3).reduce((sum, { joint_states: n }) => sum + n, 0);
  write("cut_in_chunk.mcap", packed.subarray(0, cut[3].start + (cut[3].size >> 1)), { joint_states: inFront });

  // A bit of a measured effort is flipped: the records can still be read, only the checksum tells.
  const some = joints.slice(0, 18);
  const flipped = await bag(some, { chunkSize: 1500 });
  const bad = (await chunks(flipped))[1];
  const hit = joints.find((m) => m.topic === "/joint_states" && flipped.indexOf(m.cdr) > bad.start);
  flipped[flipped.indexOf(hit.cdr) + hit.cdr.length - 6] ^= 0x10;
  const elsewhere = some.filter((m) => m.topic === "/joint_states").length - bad.joint_states;
  write("bad_crc.mcap", flipped, { bad_chunk: 1, joint_states_in_it: bad.joint_states,
                                   joint_states_elsewhere: elsewhere });

  // Three joint states, then a Message record that says it is 2^62 bytes long.
  const plain = await bag(first.slice(0, 3), { useChunks: false });
  const record = Buffer.alloc(9 + 64);
  record[0] = 0x05;
  record.writeBigUInt64LE(1n << 62n, 1);
  const dataEnd = plain.indexOf(first[2].cdr) + first[2].cdr.length;
  write("huge_length.mcap", Buffer.concat([plain.subarray(0, dataEnd), record]), { joint_states: 3 });

  // The second of four chunks says some hundred bytes; its frame decompresses to 256 MB and does not say so.
  const bomb = spawnSync("sh", ["-c", "head -c 268435456 /dev/zero | zstd -c -3"], { maxBuffer: 1 << 20 }).stdout;
  let count = 0;
  const two = await bag(first, { chunkSize: 500, compressChunk: (c) => {
    return count++ === 1 ? { compression: "zstd", compressedData: bomb } : compressChunk(c);
  } });
  const inChunk = (await chunks(two)).map((c) => c.joint_states);
  write("zstd_bomb.mcap", two, { bad_chunk: 1, joint_states_in_it: inChunk[1],
                                 joint_states_elsewhere: first.length - inChunk[1] });

  const deep = first.slice(0, 3).map((m) => ({ ...m }));
  deep[1].cdr = jointState(deep[1].value, EncapsulationKind.CDR_LE, 0xffffffff);
  write("deep_names.mcap", await bag(deep), { joint_states: 2, bad_message: 1 });

  fs.writeFileSync(path.join(data, "damaged.json"), JSON.stringify(damaged, null, 1) + "\n");
  fs.writeFileSync(path.join(work, "cdr.json"), JSON.stringify({
    types: content.types, qos,
    schemas: Object.fromEntries(Object.values(content.types).map((t) => [t, schemaText(t, false)])),
    messages: all.map(({ topic, receive_ns, cdr }) => [topic, receive_ns, Buffer.from(cdr).toString("base64")]),
  }));
}
main();
