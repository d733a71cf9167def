fn main() {
    let c = shaderc::Compiler::new().unwrap();
    let _ = c;
}
