"""The report of a campaign: one HTML file that holds everything it shows."""

from html import escape
from pathlib import Path
from typing import Final

from cosmic.autonomy.campaign.report_data import report_data
from cosmic.autonomy.campaign.report_html import body
from cosmic.autonomy.campaign.store import CampaignStore
from cosmic.autonomy.campaign.store_files import write_whole
from cosmic.autonomy.campaign.store_read import CampaignReader

STYLE: Final = """
body { font-family: "Segoe UI", "Noto Sans", sans-serif; color: #202428; background: #ffffff;
  max-width: 62rem; margin: 2rem auto; padding: 0 1rem; line-height: 1.45; }
h1 { font-size: 1.6rem; } h2 { font-size: 1.2rem; margin-top: 2rem; }
h3 { font-size: 1rem; margin-top: 2rem; border-top: 1px solid #d9dde1; padding-top: 0.8rem; }
table { border-collapse: collapse; font-size: 0.88rem; font-variant-numeric: tabular-nums; }
table:not(.plain) tr { border-bottom: 1px solid #d9dde1; }
.scroll { overflow-x: auto; } .figure { margin: 0.4rem 0; } .figure svg { max-width: 100%; }
img { max-width: 100%; height: auto; } pre { background: #f3f5f7; padding: 0.8rem;
  overflow-x: auto; } small { color: #596068; }
@media print { h3 { break-before: auto; } table, .figure { break-inside: avoid; } }
"""


def write_report(campaign: CampaignStore | CampaignReader, path: str | Path) -> None:
    """Write the report of a campaign as one HTML file, which needs no other file.

    The campaign may still be running, and be written by another process.

    Raises
    ------
    CampaignError
        The campaign cannot be read, or the file not be written.
    """
    reader = campaign.reader if isinstance(campaign, CampaignStore) else campaign
    data = report_data(reader)
    title = f"{data.info.name}: {data.info.procedure}"
    page = (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{STYLE}</style></head>\n"
        f"<body>\n{body(data)}\n</body></html>\n"
    )
    write_whole(Path(path), page.encode())
