"""Alembic's environment: migrates over the connection that `vsnbench.results.schema.migrate` hands in."""

from alembic import context

from vsnbench.results.schema.tables import TableBase


def run() -> None:
    """Migrate; SQLite alters a table by rebuilding it, so its foreign keys are off until every row is checked."""
    connection = context.config.attributes["connection"]
    context.configure(
        connection=connection,
        target_metadata=TableBase.metadata,
        render_as_batch=True,
        compare_type=True,
        transaction_per_migration=False,
    )
    with context.begin_transaction():
        context.run_migrations()


run()
