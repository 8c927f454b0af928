//! Compiles every row of `shaders/kernels.txt` to SPIR-V and writes the table of kernels.
//!
//! The GLSL side of `src/layout.rs` is generated here; includes are resolved here; and the offsets
//! that the compiler gave to every shared record are checked against Rust's.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::{Capability, Decoration, Op, StorageClass};
use shaderc_link as _;

#[path = "src/layout.rs"]
#[allow(dead_code)]
mod layout;

/// A kernel of `kernels.txt`.
struct Row {
    name: String,
    entry: String,
    traverse: String,
    nodes: String,
    accessor: String,
    defines: Vec<(String, Option<String>)>,
}

type Failure = Box<dyn std::error::Error + Send + Sync>;

fn main() {
    println!("cargo:rerun-if-changed=shaders");
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=src/layout.rs");
    if let Err(failure) = run() {
        eprintln!("{failure}");
        std::process::exit(1);
    }
}

fn run() -> Result<(), Failure> {
    let out = PathBuf::from(std::env::var("OUT_DIR")?);
    let list = std::fs::read_to_string("shaders/kernels.txt")?;
    let mut table = String::from("pub const KERNELS: &[Kernel] = &[\n");
    let mut hash = xxhash_rust::xxh3::Xxh3::new();
    let mut checked = BTreeSet::new();
    let rows = rows(&list)?;
    for (row, compiled) in rows.iter().zip(compile_all(&rows, &out)?) {
        hash.update(row.name.as_bytes());
        hash.update(&compiled.spirv);
        writeln!(table, "{}", compiled.entry)?;
        if let Some(named) = compiled.named {
            check_offsets(row, &named, &mut checked)?;
        }
    }
    if let Some(record) = layout::RECORDS.iter().find(|record| !checked.contains(record.name)) {
        return Err(format!("no kernel shows the offsets of {}", record.name).into());
    }
    writeln!(
        table,
        "];\n/// Of every kernel's name and SPIR-V.\npub const SPIRV_HASH: u64 = {:#x};",
        hash.digest()
    )?;
    std::fs::write(out.join("kernels.rs"), table)?;
    Ok(())
}

/// What becomes of a row.
struct Compiled {
    /// Of the table.
    entry: String,
    spirv: Vec<u8>,
    /// The same with names, of the rows that show all records.
    named: Option<Vec<u32>>,
}

/// Compiles all rows, several at once.
fn compile_all(rows: &[Row], out: &Path) -> Result<Vec<Compiled>, Failure> {
    let next = AtomicUsize::new(0);
    let work = || -> Result<Vec<(usize, Compiled)>, Failure> {
        let compiler = shaderc::Compiler::new()?;
        let mut done = Vec::new();
        loop {
            let number = next.fetch_add(1, Ordering::Relaxed);
            let Some(row) = rows.get(number) else { return Ok(done) };
            done.push((number, compile_row(&compiler, row, number, out)?));
        }
    };
    let threads = std::thread::available_parallelism().map_or(1, |threads| threads.get());
    let mut done = Vec::new();
    std::thread::scope(|scope| -> Result<(), Failure> {
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        for worker in workers {
            done.extend(worker.join().map_err(|_| "a thread that compiled kernels panicked")??);
        }
        Ok(())
    })?;
    done.sort_by_key(|(number, _)| *number);
    Ok(done.into_iter().map(|(_, compiled)| compiled).collect())
}

fn compile_row(
    compiler: &shaderc::Compiler,
    row: &Row,
    number: usize,
    out: &Path,
) -> Result<Compiled, Failure> {
    let spirv = compile(compiler, row, shaderc::OptimizationLevel::Performance)?;
    let glsl = out.join(format!("kernel{number}.glsl"));
    std::fs::write(&glsl, opengl_text(compiler, row, spirv.as_binary())?)?;
    let file = out.join(format!("kernel{number}.spv"));
    std::fs::write(&file, spirv.as_binary_u8())?;
    // These show all records. The optimizer strips the names that reflection goes by.
    let named = match row.entry.ends_with("records.comp.glsl") {
        true => Some(compile(compiler, row, shaderc::OptimizationLevel::Zero)?.as_binary().to_vec()),
        false => None,
    };
    Ok(Compiled {
        entry: table_entry(row, &file, &glsl, spirv.as_binary())?,
        spirv: spirv.as_binary_u8().to_vec(),
        named,
    })
}

fn rows(list: &str) -> Result<Vec<Row>, Failure> {
    let mut rows: Vec<Row> = Vec::new();
    for (index, line) in list.lines().enumerate() {
        if line.trim().is_empty() || line.trim_start().starts_with('#') {
            continue;
        }
        let wrong = |what: String| format!("shaders/kernels.txt:{}: {what}", index + 1);
        for line in alternatives(line) {
            let columns: Vec<&str> = line.split_whitespace().collect();
            let [name, entry, traverse, nodes, accessor, defines] = columns[..] else {
                return Err(wrong(format!("a row has 6 columns, this one {}", columns.len())).into());
            };
            if rows.iter().any(|row| row.name == name) {
                return Err(wrong(format!("the name {name} stands twice")).into());
            }
            let defines = defines.split(',').filter(|&define| define != "-").map(|define| {
                match define.split_once('=') {
                    Some((key, value)) => (key.to_string(), Some(value.to_string())),
                    None => (define.to_string(), None),
                }
            });
            rows.push(Row {
                name: name.into(),
                entry: format!("shaders/{entry}.glsl"),
                traverse: format!("shaders/traverse/{traverse}.glsl"),
                nodes: nodes.into(),
                accessor: accessor.into(),
                defines: defines.collect(),
            });
        }
    }
    Ok(rows)
}

/// The lines that a line with `{a,b}` stands for, one for each choice in each pair of braces; `$1` is what was
/// chosen in the first pair, and so on.
fn alternatives(line: &str) -> Vec<String> {
    let mut lines = vec![(line.to_string(), Vec::<String>::new())];
    while let Some(open) = lines[0].0.find('{') {
        lines = lines
            .into_iter()
            .flat_map(|(line, chosen)| {
                let open = line.find('{').unwrap_or(open);
                let close = line[open..].find('}').map_or(line.len(), |length| open + length);
                let (before, choices) = (&line[..open], &line[open + 1..close]);
                let after = line.get(close + 1..).unwrap_or("");
                let with = |choice: &str| {
                    let all = chosen.iter().cloned().chain([choice.to_string()]).collect();
                    (format!("{before}{choice}{after}"), all)
                };
                choices.split(',').map(with).collect::<Vec<_>>()
            })
            .collect();
    }
    let fill = |(line, chosen): (String, Vec<String>)| {
        chosen
            .iter()
            .enumerate()
            .fold(line, |line, (place, choice)| line.replace(&format!("${}", place + 1), choice))
    };
    lines.into_iter().map(fill).collect()
}

fn compile(
    compiler: &shaderc::Compiler,
    row: &Row,
    optimization: shaderc::OptimizationLevel,
) -> Result<shaderc::CompilationArtifact, Failure> {
    let seen = RefCell::new(Vec::new());
    let mut options = options(row, &seen)?;
    options.set_target_env(shaderc::TargetEnv::Vulkan, shaderc::EnvVersion::Vulkan1_2 as u32);
    options.set_forced_version_profile(460, shaderc::GlslProfile::None);
    options.set_optimization_level(optimization);
    compiler
        .compile_into_spirv(&entry_text(row)?, stage(row)?, &row.entry, "main", Some(&options))
        .map_err(|error| format!("kernel {}:\n{error}", row.name).into())
}

/// The same text for an OpenGL driver: includes and macros resolved, specialization constants left as
/// `SPECIALIZED(id)`.
/// Empty where the kernel needs what OpenGL 4.3 does not have.
fn opengl_text(compiler: &shaderc::Compiler, row: &Row, spirv: &[u32]) -> Result<String, Failure> {
    let module = load(row, spirv)?;
    if !subgroup_operations(&module).is_empty() || reads_by_address(&module) {
        return Ok(String::new());
    }
    let seen = RefCell::new(Vec::new());
    let mut options = options(row, &seen)?;
    options.set_target_env(shaderc::TargetEnv::OpenGL, shaderc::EnvVersion::OpenGL4_5 as u32);
    options.set_forced_version_profile(430, shaderc::GlslProfile::Core);
    let artifact = compiler
        .preprocess(&entry_text(row)?, &row.entry, "main", Some(&options))
        .map_err(|error| format!("kernel {}:\n{error}", row.name))?;
    // Drivers know neither these directives' file names nor the extension that allows them.
    let text = artifact.as_text();
    let lines = text.lines().filter(|line| !line.starts_with('#') && !line.trim().is_empty());
    Ok(lines.fold(String::from("#version 430 core\n"), |text, line| text + line + "\n"))
}

/// The stage that the file's name tells.
fn stage(row: &Row) -> Result<shaderc::ShaderKind, Failure> {
    match row.entry.rsplit('.').nth(1) {
        Some("comp") => Ok(shaderc::ShaderKind::Compute),
        Some("vert") => Ok(shaderc::ShaderKind::Vertex),
        Some("frag") => Ok(shaderc::ShaderKind::Fragment),
        _ => Err(format!("kernel {}: {} names no stage (.comp, .vert, .frag)", row.name, row.entry).into()),
    }
}

fn entry_text(row: &Row) -> Result<String, Failure> {
    Ok(std::fs::read_to_string(&row.entry).map_err(|error| format!("{}: {error}", row.entry))?)
}

/// What both APIs' compilations share. An include is inlined where it first appears, so that files may
/// name what they need; `seen` remembers them.
fn options<'a>(row: &'a Row, seen: &'a RefCell<Vec<String>>) -> Result<shaderc::CompileOptions<'a>, Failure> {
    let mut options = shaderc::CompileOptions::new()?;
    options.set_warnings_as_errors();
    options.add_macro_definition(&format!("ACCESSOR_{}", row.accessor.to_uppercase()), None);
    if row.nodes != "-" {
        options.add_macro_definition(&format!("NODES_{}", row.nodes.to_uppercase()), None);
    }
    for (key, value) in &row.defines {
        options.add_macro_definition(key, value.as_deref());
    }
    options.set_include_callback(move |wanted, _, from, _| {
        let (path, content) = include(wanted, from, row)?;
        let mut seen = seen.borrow_mut();
        let first = !seen.contains(&path);
        seen.push(path.clone());
        Ok(shaderc::ResolvedInclude {
            resolved_name: path,
            content: if first { content } else { "\n".into() },
        })
    });
    Ok(options)
}

/// Path and text of an include: generated, the row's traversal, or a file under `shaders/`.
fn include(wanted: &str, from: &str, row: &Row) -> Result<(String, String), String> {
    match wanted {
        "layout" => return Ok(("layout".into(), glsl_layout())),
        "record_copies" => return Ok(("record_copies".into(), glsl_record_copies())),
        _ => {}
    }
    let beside = Path::new(from).with_file_name(wanted);
    let path = match wanted {
        "traverse" => PathBuf::from(&row.traverse),
        _ if beside.exists() => beside,
        _ => Path::new("shaders").join(wanted),
    };
    let text = std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
    Ok((path.display().to_string(), text))
}

/// Structs, unpackers and constants of `src/layout.rs` in GLSL.
fn glsl_layout() -> String {
    let mut glsl = String::new();
    for (name, value) in layout::CONSTANTS {
        // Layout qualifiers take plain literals.
        let qualifier = ["BINDING_", "SPEC_", "TILE_"].iter().any(|prefix| name.starts_with(prefix));
        let suffix = if qualifier { "" } else { "u" };
        glsl += &format!("#define {name} {value}{suffix}\n");
    }
    for record in layout::RECORDS {
        glsl += &format!("struct {} {{\n", record.name);
        for field in record.fields {
            glsl += &format!("    {} {};\n", field.glsl, field.name);
        }
        glsl += "};\n";
        let words = record.size / 16;
        let loads: String =
            (0..words).map(|word| format!("uvec4 w{word} = WORD((i) * {words}u + {word}u); ")).collect();
        let fields: Vec<String> = record.fields.iter().map(glsl_field).collect();
        glsl +=
            &format!("#define LOAD_{0}(WORD, i) {loads}return {0}({1});\n", record.name, fields.join(", "));
    }
    glsl
}

/// A field, taken out of the 16-byte words w0, w1, ...
fn glsl_field(field: &layout::Field) -> String {
    let word = field.offset / 16;
    let component = ["x", "y", "z", "w"][field.offset % 16 / 4];
    match field.glsl {
        "vec3" => format!("uintBitsToFloat(w{word}.xyz)"),
        "float" => format!("uintBitsToFloat(w{word}.{component})"),
        "int" => format!("int(w{word}.{component})"),
        _ => format!("w{word}.{component}"),
    }
}

/// `copy_record(kind, i)`: record i through the node accessor, into an array of structs.
fn glsl_record_copies() -> String {
    let mut glsl = String::new();
    let mut cases = String::new();
    for (kind, record) in layout::RECORDS.iter().enumerate() {
        let name = record.name;
        glsl += &format!(
            "STORAGE_BLOCK(BINDING_HITS) writeonly buffer {name}Copies {{ {name} copies_{kind}[]; }};\n"
        );
        glsl += &format!("{name} read_{kind}(uint i) {{ LOAD_{name}(NODE_WORD, i) }}\n");
        cases += &format!("    if (kind == {kind}u) copies_{kind}[i] = read_{kind}(i);\n");
    }
    glsl + "void copy_record(uint kind, uint i) {\n" + &cases + "}\n"
}

/// Compares the offsets of shared records with `src/layout.rs`; adds the records found to `checked`.
fn check_offsets(row: &Row, spirv: &[u32], checked: &mut BTreeSet<&'static str>) -> Result<(), Failure> {
    let module = load(row, spirv)?;
    let reflection = Reflection::new(&module);
    Ok(reflection.check_offsets(checked).map_err(|error| format!("kernel {}: {error}", row.name))?)
}

fn load(row: &Row, spirv: &[u32]) -> Result<Module, Failure> {
    Ok(rspirv::dr::load_words(spirv).map_err(|error| format!("kernel {}: {error}", row.name))?)
}

/// A row of the table of kernels: name, SPIR-V, descriptors.
fn table_entry(row: &Row, file: &Path, glsl: &Path, spirv: &[u32]) -> Result<String, Failure> {
    let module = load(row, spirv)?;
    let reflection = Reflection::new(&module);
    let mut bindings = BTreeMap::new();
    for variable in &module.types_global_values {
        let Some(binding) = variable.result_id.and_then(|id| reflection.bindings.get(&id)) else { continue };
        let kind = reflection.descriptor_kind(variable).map_err(|kind| {
            format!("kernel {}: binding {binding} is {kind}, which the host cannot bind", row.name)
        })?;
        bindings.insert(*binding, kind);
    }
    let list: String =
        bindings.iter().map(|(binding, kind)| format!("({binding}, DescriptorKind::{kind}), ")).collect();
    Ok(format!(
        "    Kernel {{ name: {:?}, spirv: include_bytes!({:?}), glsl: include_str!({:?}), bindings: &[{list}], \
         nodes: NodeLayout::{}, subgroup: &{:?}, by_address: {} }},",
        row.name,
        file.display().to_string(),
        glsl.display().to_string(),
        node_layout(row)?,
        subgroup_operations(&module),
        reads_by_address(&module),
    ))
}

/// The host's name for the layout of the nodes that a kernel reads.
fn node_layout(row: &Row) -> Result<&'static str, Failure> {
    Ok(match row.nodes.as_str() {
        "-" => "None",
        "single" => "Single",
        "threaded" => "Threaded",
        "threaded48" => "Threaded48",
        "pair" => "Pair",
        "centred" => "Centred",
        "wide" => "Wide",
        "quad" => "Quad",
        "faces" => "Faces",
        other => return Err(format!("kernel {}: there is no node layout {other}", row.name).into()),
    })
}

/// Classes of subgroup operations that a kernel uses.
fn subgroup_operations(module: &Module) -> Vec<&'static str> {
    let name = |instruction: &Instruction| match instruction.operands.first() {
        Some(Operand::Capability(capability)) => match capability {
            Capability::GroupNonUniform => Some("basic"),
            Capability::GroupNonUniformVote => Some("vote"),
            Capability::GroupNonUniformArithmetic => Some("arithmetic"),
            Capability::GroupNonUniformBallot => Some("ballot"),
            Capability::GroupNonUniformShuffle => Some("shuffle"),
            Capability::GroupNonUniformQuad => Some("quad"),
            _ => None,
        },
        _ => None,
    };
    module.capabilities.iter().filter_map(name).collect()
}

/// Whether a kernel reads buffers by their device addresses.
fn reads_by_address(module: &Module) -> bool {
    let capability = Operand::Capability(Capability::PhysicalStorageBufferAddresses);
    module.capabilities.iter().any(|instruction| instruction.operands.first() == Some(&capability))
}

/// Names, decorations and types of a module, by id.
struct Reflection<'a> {
    types: BTreeMap<u32, &'a Instruction>,
    struct_names: BTreeMap<u32, &'a str>,
    offsets: BTreeMap<(u32, u32), u32>,
    bindings: BTreeMap<u32, u32>,
}

impl<'a> Reflection<'a> {
    fn new(module: &'a Module) -> Self {
        let types = module.types_global_values.iter().filter_map(|i| Some((i.result_id?, i))).collect();
        let mut struct_names = BTreeMap::new();
        for name in &module.debug_names {
            if let (Op::Name, [Operand::IdRef(id), Operand::LiteralString(text)]) =
                (name.class.opcode, &name.operands[..])
            {
                struct_names.insert(*id, text.as_str());
            }
        }
        let mut offsets = BTreeMap::new();
        let mut bindings = BTreeMap::new();
        for annotation in &module.annotations {
            match &annotation.operands[..] {
                [
                    Operand::IdRef(id),
                    Operand::LiteralBit32(member),
                    Operand::Decoration(Decoration::Offset),
                    Operand::LiteralBit32(offset),
                ] => {
                    offsets.insert((*id, *member), *offset);
                }
                [
                    Operand::IdRef(id),
                    Operand::Decoration(Decoration::Binding),
                    Operand::LiteralBit32(binding),
                ] => {
                    bindings.insert(*id, *binding);
                }
                _ => {}
            }
        }
        Self { types, struct_names, offsets, bindings }
    }

    /// The host's name for what a variable binds, or what it is instead.
    fn descriptor_kind(&self, variable: &Instruction) -> Result<&'static str, String> {
        let pointee = variable
            .result_type
            .and_then(|pointer| self.types.get(&pointer))
            .and_then(|pointer| pointer.operands.get(1)?.id_ref_any())
            .and_then(|id| self.types.get(&id));
        let Some(Operand::StorageClass(class)) = variable.operands.first() else {
            return Err("no variable".into());
        };
        match (class, pointee) {
            (StorageClass::Uniform, _) => Ok("UniformBuffer"),
            (StorageClass::StorageBuffer, _) => Ok("StorageBuffer"),
            (StorageClass::UniformConstant, Some(image)) if image.class.opcode == Op::TypeImage => {
                let of_buffer = image.operands[1] == Operand::Dim(rspirv::spirv::Dim::DimBuffer);
                Ok(if of_buffer { "UniformTexelBuffer" } else { "StorageImage" })
            }
            (class, _) => Err(format!("{class:?}")),
        }
    }

    /// Compares every struct that bears a record's name and has a layout with `src/layout.rs`; adds
    /// the records found to `checked`.
    fn check_offsets(&self, checked: &mut BTreeSet<&'static str>) -> Result<(), String> {
        for (id, name) in &self.struct_names {
            let Some(record) = layout::RECORDS.iter().find(|record| record.name == *name) else { continue };
            for (member, field) in record.fields.iter().enumerate() {
                // A copy in a local variable has no layout.
                let Some(&offset) = self.offsets.get(&(*id, member as u32)) else { continue };
                checked.insert(record.name);
                if offset as usize != field.offset {
                    return Err(format!(
                        "{name}.{} lies at {offset} in SPIR-V, at {} in src/layout.rs",
                        field.name, field.offset
                    ));
                }
            }
        }
        Ok(())
    }
}
