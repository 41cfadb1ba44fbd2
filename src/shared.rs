//! Declarations that Rust and WGSL share: [`shared!`] turns one declaration into the Rust item and the WGSL text of the module of the
//! same path.
//!
//! ```ignore
//! shared! {
//!     /// Bits of `Thing::flags`.
//!     pub const THING_BRIGHT: u32 = 1;
//!     /// A thing in a buffer.
//!     #[derive(Clone, Copy, Pod, Zeroable)]
//!     pub struct Thing {
//!         pub colour: Vec3,
//!         pub flags: u32,
//!     }
//! }
//! ```
//!
//! In `src/material/thing.rs`, that gives the two Rust items and, to `shaders/material/thing.wgsl` or in its place, the constant and the
//! struct that other shaders import as `package::material::thing::Thing`. Records are `#[repr(C)]`; one whose fields lie elsewhere in WGSL
//! (a `vec3` begins at multiples of 16 bytes) does not compile until it is padded by hand. What lies in no buffer, and is only passed and
//! returned, is declared as `value struct`: either side lays it out as it likes, and it may hold `bool`. A file has one `shared!` block, and
//! [`Composer`](crate::gpu::Composer) is told of its `SHARED`.

use std::fmt::Write;

/// A type that a shared record may hold.
pub trait Shared {
    /// Bytes, of the WGSL type.
    const ALIGN: usize;
    /// Bytes, of the WGSL type.
    const SIZE: usize;

    /// The WGSL type; records by their full path.
    fn wgsl() -> String;
}

/// A type that a shared constant may have.
pub trait SharedValue {
    fn value(self) -> Value;
}

/// The value of a constant as WGSL has it; several numbers are a vector if there are at most four, else an array.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    U32(u32),
    I32(i32),
    F32(f32),
    U32s(Vec<u32>),
    F32s(Vec<f32>),
}

impl Value {
    /// Type and literal; the literal has the very bits.
    fn wgsl(&self) -> (String, String) {
        match self {
            Self::U32(x) => ("u32".to_owned(), format!("{x}u")),
            Self::I32(x) => ("i32".to_owned(), format!("{x}i")),
            Self::F32(x) => ("f32".to_owned(), format!("{x:?}f")),
            Self::U32s(parts) => several("u32", parts.iter().map(|x| format!("{x}u"))),
            Self::F32s(parts) => several("f32", parts.iter().map(|x| format!("{x:?}f"))),
        }
    }
}

/// Type and value of a vector or array.
fn several(kind: &str, parts: impl ExactSizeIterator<Item = String>) -> (String, String) {
    let kind = match parts.len() {
        count @ 2..=4 => format!("vec{count}<{kind}>"),
        count => format!("array<{kind}, {count}>"),
    };
    let parts: Vec<String> = parts.collect();
    let value = format!("{kind}({})", parts.join(", "));
    (kind, value)
}

/// One constant.
pub struct Constant {
    pub name: &'static str,
    pub value: fn() -> Value,
}

/// One field of a record; bytes as Rust lays it out.
pub struct Field {
    pub name: &'static str,
    pub offset: usize,
    pub size: usize,
    pub wgsl: fn() -> String,
}

/// One record.
pub struct Record {
    pub name: &'static str,
    /// Lies in no buffer.
    pub is_value: bool,
    /// Bytes.
    pub size: usize,
    pub fields: &'static [Field],
}

/// What one Rust file shares with the shaders.
pub struct Module {
    /// As Rust names it, from the crate's name on.
    pub rust_path: &'static str,
    pub constants: &'static [Constant],
    pub records: &'static [Record],
}

impl Module {
    /// Path in the shaders' package: `packed::records`.
    pub fn path(&self) -> &'static str {
        self.rust_path
            .split_once("::")
            .map_or(self.rust_path, |(_, path)| path)
    }

    /// The declarations in WGSL.
    pub fn wgsl(&self) -> String {
        let here = format!("package::{}::", self.path());
        let mut text = String::new();
        for constant in self.constants {
            let (kind, literal) = (constant.value)().wgsl();
            let _ = writeln!(text, "const {}: {kind} = {literal};", constant.name);
        }
        for record in self.records {
            let _ = writeln!(text, "struct {} {{", record.name);
            for field in record.fields {
                // A record of this very module by its bare name: WESL strips what is named by the path of the module it stands in.
                let kind = (field.wgsl)().replace(&here, "");
                let _ = writeln!(text, "    {}: {kind},", field.name);
            }
            text.push_str("}\n");
        }
        text
    }
}

/// Full path in the shaders' package of a record that is declared in a Rust module.
pub(crate) fn path_of(rust_module: &str, record: &str) -> String {
    let module = rust_module.split_once("::").map_or("", |(_, path)| path);
    format!("package::{module}::{record}")
}

/// WGSL's `array<T, N>`, for a field that Rust holds as `[T; N]` and that is not meant to be a vector: `field: [f32; 3] as Array<f32, 3>`.
pub struct Array<T, const N: usize>(std::marker::PhantomData<T>);

impl<T: Shared, const N: usize> Shared for Array<T, N> {
    const ALIGN: usize = T::ALIGN;
    const SIZE: usize = N * T::SIZE.next_multiple_of(T::ALIGN);

    fn wgsl() -> String {
        format!("array<{}, {N}>", T::wgsl())
    }
}

/// An array of vectors needs no `as`.
impl<const N: usize> Shared for [[f32; 4]; N] {
    const ALIGN: usize = 16;
    const SIZE: usize = 16 * N;

    fn wgsl() -> String {
        Array::<[f32; 4], N>::wgsl()
    }
}

macro_rules! plain_types {
    ($($rust:ty: $align:literal $size:literal $wgsl:literal,)*) => {
        $(impl Shared for $rust {
            const ALIGN: usize = $align;
            const SIZE: usize = $size;

            fn wgsl() -> String {
                $wgsl.to_owned()
            }
        })*
    };
}

plain_types! {
    u32: 4 4 "u32",
    i32: 4 4 "i32",
    bool: 1 1 "bool",
    f32: 4 4 "f32",
    [f32; 2]: 8 8 "vec2<f32>",
    [f32; 3]: 16 12 "vec3<f32>",
    [f32; 4]: 16 16 "vec4<f32>",
    [u32; 2]: 8 8 "vec2<u32>",
    [u32; 3]: 16 12 "vec3<u32>",
    [u32; 4]: 16 16 "vec4<u32>",
    glam::Vec3: 16 12 "vec3<f32>",
}

impl SharedValue for u32 {
    fn value(self) -> Value {
        Value::U32(self)
    }
}

/// Lengths of arrays are `usize` in Rust and `u32` in WGSL.
impl SharedValue for usize {
    fn value(self) -> Value {
        Value::U32(u32::try_from(self).expect("a shared length fits 32 bits"))
    }
}

impl SharedValue for i32 {
    fn value(self) -> Value {
        Value::I32(self)
    }
}

impl SharedValue for f32 {
    fn value(self) -> Value {
        assert!(self.is_finite(), "WGSL has no literal for {self}");
        Value::F32(self)
    }
}

impl SharedValue for glam::Vec3 {
    fn value(self) -> Value {
        self.to_array().value()
    }
}

impl<const N: usize> SharedValue for [f32; N] {
    fn value(self) -> Value {
        Value::F32s(self.to_vec())
    }
}

impl<const N: usize> SharedValue for [u32; N] {
    fn value(self) -> Value {
        Value::U32s(self.to_vec())
    }
}

/// Declares constants and records for both sides; see the module's text.
macro_rules! shared {
    // The end: all names are known.
    (@item [$($constant:ident)*] [$(($record:ident $is_value:literal $($field:ident: ($($kind:tt)*),)*))*]) => {
        /// What this file shares with the shaders.
        pub(crate) const SHARED: $crate::shared::Module = $crate::shared::Module {
            rust_path: module_path!(),
            constants: &[$($crate::shared::Constant {
                name: stringify!($constant),
                value: || $crate::shared::SharedValue::value($constant),
            },)*],
            records: &[$($crate::shared::Record {
                name: stringify!($record),
                is_value: $is_value,
                size: size_of::<$record>(),
                fields: &[$($crate::shared::Field {
                    name: stringify!($field),
                    offset: std::mem::offset_of!($record, $field),
                    size: <shared!(@wgsl $($kind)*) as $crate::shared::Shared>::SIZE,
                    wgsl: <shared!(@wgsl $($kind)*) as $crate::shared::Shared>::wgsl,
                },)*],
            },)*],
        };
    };
    (@item [$($constants:tt)*] $records:tt
        $(#[$meta:meta])* $vis:vis const $name:ident: $kind:ty = $value:expr; $($rest:tt)*
    ) => {
        $(#[$meta])*
        $vis const $name: $kind = $value;
        shared!(@item [$($constants)* $name] $records $($rest)*);
    };
    (@item $constants:tt [$($records:tt)*]
        $(#[$meta:meta])* $vis:vis struct $name:ident {
            $($(#[$field_meta:meta])* $field_vis:vis $field:ident: $kind:ty $(as $wgsl:ty)?),* $(,)?
        } $($rest:tt)*
    ) => {
        #[repr(C)]
        $(#[$meta])*
        $vis struct $name {
            $($(#[$field_meta])* $field_vis $field: $kind,)*
        }

        impl $crate::shared::Shared for $name {
            const ALIGN: usize = {
                let mut align = 1;
                $(if <shared!(@wgsl $kind $(as $wgsl)?) as $crate::shared::Shared>::ALIGN > align {
                    align = <shared!(@wgsl $kind $(as $wgsl)?) as $crate::shared::Shared>::ALIGN;
                })*
                align
            };
            const SIZE: usize = size_of::<Self>();

            fn wgsl() -> String {
                $crate::shared::path_of(module_path!(), stringify!($name))
            }
        }

        // The fields lie where WGSL puts them.
        const _: () = {
            let mut end: usize = 0;
            $(
                end = end.next_multiple_of(<shared!(@wgsl $kind $(as $wgsl)?) as $crate::shared::Shared>::ALIGN);
                assert!(
                    end == std::mem::offset_of!($name, $field),
                    concat!(stringify!($name), "::", stringify!($field), " lies elsewhere in WGSL: pad before it"),
                );
                end += <shared!(@wgsl $kind $(as $wgsl)?) as $crate::shared::Shared>::SIZE;
            )*
            assert!(
                end.next_multiple_of(<$name as $crate::shared::Shared>::ALIGN) == size_of::<$name>(),
                concat!(stringify!($name), " is longer in WGSL: pad its end"),
            );
        };

        shared!(@item $constants
            [$($records)* ($name false $($field: ($kind $(as $wgsl)?),)*)] $($rest)*);
    };
    (@item $constants:tt [$($records:tt)*]
        $(#[$meta:meta])* $vis:vis value struct $name:ident {
            $($(#[$field_meta:meta])* $field_vis:vis $field:ident: $kind:ty),* $(,)?
        } $($rest:tt)*
    ) => {
        $(#[$meta])*
        $vis struct $name {
            $($(#[$field_meta])* $field_vis $field: $kind,)*
        }

        impl $crate::shared::Shared for $name {
            const ALIGN: usize = align_of::<Self>();
            const SIZE: usize = size_of::<Self>();

            fn wgsl() -> String {
                $crate::shared::path_of(module_path!(), stringify!($name))
            }
        }

        shared!(@item $constants [$($records)* ($name true $($field: ($kind),)*)] $($rest)*);
    };
    (@wgsl $kind:ty) => { $kind };
    (@wgsl $kind:ty as $wgsl:ty) => { $wgsl };
    ($($items:tt)*) => {
        shared!(@item [] [] $($items)*);
    };
}
pub(crate) use shared;

shared! {
    /// Index that stands for "none" in every u32 reference.
    pub const NONE: u32 = u32::MAX;

    /// Threads of a workgroup.
    pub const WORKGROUP: u32 = 64;
}
