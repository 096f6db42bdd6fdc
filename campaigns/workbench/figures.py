import json
import statistics


def figures(raw):
    found = json.loads((raw / "measured.txt").read_text(encoding="utf-8"))

    def of(times, percent):
        ordered = sorted(times)
        return ordered[min(len(ordered) - 1, len(ordered) * percent // 100)]

    def sliders(times):
        return f"{statistics.median(times):.1f} ms, nine of ten below {of(times, 90):.1f} ms"

    return {
        "first paint": f"{statistics.median(found['paint_ms']):.0f} ms",
        "from a slider's move to the drawn curve, 800 rows": sliders(found["slider_800_ms"]),
        "the same, 100,000 rows": sliders(found["slider_100000_ms"]),
        "a record of 1,000,000 rows opens": f"{found['open_1000000_ms'] / 1000:.1f} s",
        "processor while a page is open and nothing happens": f"{found['idle_percent']:.1f} %",
        "a killed workbench is noticed": f"{found['noticed_ms']:.0f} ms",
        "the page goes on after the restart": f"{found['resumed_ms'] / 1000:.1f} s",
        "the table of 300 records opens": f"{found['table_ms'] / 1000:.1f} s",
        "from a dropped table to an error at the noise": f"{found['loop_ms'] / 1000:.0f} s",
    }, {}
