//! The table as a Parquet file. What is unknown is NULL, in every column; the file's metadata has what the columns mean.

use std::fs::File;
use std::io::Write;
use std::sync::Arc;

use parquet::basic::{LogicalType, Repetition, TimeUnit, Type as Physical};
use parquet::column::writer::ColumnWriterImpl;
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DataType, DoubleType, Int32Type, Int64Type};
use parquet::errors::Result;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;

use super::columns::{COLUMNS, Value};
use super::row::Row;

/// Begins the name of the program in the file's metadata, before its version.
const CREATED_BY: &str = "rover-battmon version ";

/// Key of the version among the meanings of columns. Programs that put tables together, as `examples/fleet.py`, keep it.
const MARK: &str = "rover-battmon";

/// Whether a file is a table that this program wrote, or one that was made of such tables.
pub fn is_table(file: File) -> bool {
    let table = SerializedFileReader::new(file);
    table.is_ok_and(|table| {
        let metadata = table.metadata().file_metadata();
        let created_by = metadata.created_by();
        let mut keys = metadata.key_value_metadata().into_iter().flatten();
        created_by.is_some_and(|program| program.starts_with(CREATED_BY)) || keys.any(|pair| pair.key == MARK)
    })
}

/// Writes the rows as one row group.
pub fn write(rows: &[Row], file: impl Write + Send) -> Result<()> {
    let meanings = COLUMNS
        .iter()
        .map(|column| KeyValue::new(column.name.into(), column.meaning.to_owned()));
    let mark = KeyValue::new(MARK.into(), env!("CARGO_PKG_VERSION").to_owned());
    let properties = WriterProperties::builder()
        .set_created_by(format!("{CREATED_BY}{}", env!("CARGO_PKG_VERSION")))
        .set_key_value_metadata(Some(meanings.chain([mark]).collect()));
    let mut writer = SerializedFileWriter::new(file, Arc::new(schema()?), Arc::new(properties.build()))?;
    let mut group = writer.next_row_group()?;
    for column in COLUMNS {
        let Some(mut writer) = group.next_column()? else {
            break;
        };
        match column.value {
            Value::Text(value) => put(writer.typed::<ByteArrayType>(), rows, |row| {
                value(row).map(|text| ByteArray::from(text.into_bytes()))
            }),
            Value::Whole(value) => put(writer.typed::<Int32Type>(), rows, value),
            Value::Number(value) => put(writer.typed::<DoubleType>(), rows, value),
            Value::Flag(value) => put(writer.typed::<BoolType>(), rows, value),
            Value::Moment(value) => put(writer.typed::<Int64Type>(), rows, |row| {
                value(row).map(|utc_s| (utc_s * 1e6).round() as i64)
            }),
        }?;
        writer.close()?;
    }
    group.close()?;
    writer.close()?;
    Ok(())
}

/// Writes what is known of a column, and for each row whether it is.
fn put<T: DataType>(
    writer: &mut ColumnWriterImpl<'_, T>,
    rows: &[Row],
    value: impl Fn(&Row) -> Option<T::T>,
) -> Result<()> {
    let values: Vec<Option<T::T>> = rows.iter().map(value).collect();
    let known: Vec<i16> = values.iter().map(|value| i16::from(value.is_some())).collect();
    let values: Vec<T::T> = values.into_iter().flatten().collect();
    writer.write_batch(&values, Some(&known), None).map(drop)
}

fn schema() -> Result<Type> {
    let fields: Result<Vec<_>> = COLUMNS
        .iter()
        .map(|column| {
            let (physical, logical) = types(&column.value);
            Type::primitive_type_builder(column.name, physical)
                .with_logical_type(logical)
                .with_repetition(Repetition::OPTIONAL)
                .build()
                .map(Arc::new)
        })
        .collect();
    Type::group_type_builder("drives").with_fields(fields?).build()
}

fn types(value: &Value) -> (Physical, Option<LogicalType>) {
    match value {
        Value::Text(_) => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
        Value::Whole(_) => (Physical::INT32, None),
        Value::Number(_) => (Physical::DOUBLE, None),
        Value::Flag(_) => (Physical::BOOLEAN, None),
        Value::Moment(_) => (
            Physical::INT64,
            Some(LogicalType::timestamp(true, TimeUnit::MICROS)),
        ),
    }
}
