# SPDX-License-Identifier: GPL-3.0-or-later
"""The German texts of the interface."""

OPERATORS = {
    "vlm.add_preset": (
        "Voreinstellung für Lichtnetze hinzufügen",
        "Das Verfahren mit seinen Einstellungen, die Effekte und die Größe der Lichtnetze unter einem Namen aufheben",
    ),
    "vlm.assign_tag": (
        "Kennung zuweisen",
        "Den gewählten Lichtnetzen und Objekten oder im Bearbeitungsmodus den gewählten Flächen eine Kennung "
        "geben: Flächen lassen die Lichter ihrer eigenen Kennung aus",
    ),
    "vlm.bake": (
        "Backen",
        "Virtuelle Lichter für die sichtbare Szene machen, wo sie keine hat, und sie prüfen",
    ),
    "vlm.bake_grid": (
        "Lichtgitter backen",
        "Backen, welche Lichter welchen Ort beleuchten, für Engines und die Kommandozeile, in einen Ordner "
        "neben der .blend-Datei",
    ),
    "vlm.check": (
        "Prüfen",
        "Suchen, was an den virtuellen Lichtnetzen falsch ist; die Befunde stehen in der Seitenleiste",
    ),
    "vlm.check_bake": (
        "Mit Gebackenem vergleichen",
        "Die Szene mit dem vergleichen, woraus ihre Lichtnetze und ihr Lichtgitter gemacht sind; liest alle "
        "sichtbare Geometrie",
    ),
    "vlm.clear_bake": (
        "Gebackenes löschen",
        "Das gebackene Lichtgitter der Szene von der Platte löschen; Lichtnetze bleiben. Nicht rückgängig zu "
        "machen: neu backen",
    ),
    "vlm.clear_tag": (
        "Kennung entfernen",
        "Die Kennungen der gewählten Lichtnetze und Objekte oder im Bearbeitungsmodus der gewählten Flächen entfernen",
    ),
    "vlm.copy_diagnostics": (
        "Diagnose kopieren",
        "Versionen, Gerät, Einstellungen und die letzten Zeilen im Protokoll des Renderers kopieren, ohne "
        "Namen von Dateien und Objekten",
    ),
    "vlm.create_again": (
        "Neu erstellen",
        "Das aktive Lichtnetz aus den Objekten neu machen, aus denen es gemacht ist; gesperrte Lichter bleiben, wie "
        "sie sind",
    ),
    "vlm.create_from_collection": (
        "Aus Sammlung erstellen",
        "Virtuelle Lichter machen, die für das reflektierte Licht der Objekte einer Sammlung stehen",
    ),
    "vlm.create_from_scene": (
        "Aus Szene erstellen",
        "Virtuelle Lichter machen, die für das reflektierte Licht von allem stehen, was die Szene zeigt, in einem "
        "Lichtnetz",
    ),
    "vlm.create_from_selection": (
        "Aus Auswahl erstellen",
        "Virtuelle Lichter machen, die für das reflektierte Licht der gewählten Objekte stehen",
    ),
    "vlm.draw_cut": (
        "Lichter schneiden",
        "Punkte quer über Lichter der gewählten Lichtnetze klicken: Sie werden entlang des Weges geteilt",
    ),
    "vlm.draw_erase": (
        "Lichter radieren",
        "Über Lichter der gewählten Lichtnetze ziehen, um sie zu löschen; gesperrte bleiben",
    ),
    "vlm.draw_extrude": (
        "Lichter entlangziehen",
        "Eine Kante eines Lichts entlang einer Fläche ziehen: Ein Streifen von Lichtern folgt",
    ),
    "vlm.draw_fill": (
        "Lichter aus gewählten Flächen",
        "Die gewählten Flächen des sichtbaren Netzes als Lichter dahinter kopieren, mit Farbe und Kennung der Fläche",
    ),
    "vlm.draw_key": (
        "Zeichentaste",
        "Was eine Taste tut, während mit einem Zeichenwerkzeug gezeichnet wird",
    ),
    "vlm.draw_polygon": (
        "Licht als Polygon zeichnen",
        "Die Ecken eines Lichts auf einer Fläche klicken oder umfahren. Es übernimmt Farbe und Kennung der Fläche",
    ),
    "vlm.draw_rectangle": (
        "Licht als Rechteck zeichnen",
        "Ein Rechteck auf eine Fläche ziehen, ein Licht oder ein Gitter davon. Sie übernehmen Farbe und "
        "Kennung der Fläche",
    ),
    "vlm.fill_color": (
        "Farbe füllen",
        "Den gewählten Lichtern eine Farbe geben; was sichtbar ist, bleibt, wie es ist",
    ),
    "vlm.fix_findings": (
        "Beheben",
        "Beheben, was die letzte Prüfung gefunden hat: Lichter hinter ihre Fläche rücken, umdrehen, dünne "
        "Körper kennzeichnen. Dauert für jede Art so lange wie eine Prüfung",
    ),
    "vlm.follow_source": (
        "Quelle folgen",
        "Die gewählten Lichtnetze ihren Quellen oder den anderen gewählten Objekten unterordnen, mit deren Rig",
    ),
    "vlm.gradient_color": (
        "Farbverlauf",
        "Die Farbe der gewählten Lichter von einer zur anderen laufen lassen, entlang einer Richtung oder "
        "zwischen zwei Punkten",
    ),
    "vlm.light_scene": (
        "Szene beleuchten",
        "Virtuelle Lichter für die sichtbare Szene machen, vorhandene Lichtnetze behalten und sie damit "
        "beleuchtet rendern",
    ),
    "vlm.link_receiver": (
        "Objekte auslassen",
        "Das Streulicht der gewählten Lichter von den gewählten sichtbaren Objekten fernhalten; direktes "
        "Licht und Schatten bleiben",
    ),
    "vlm.lock_lights": (
        "Lichter sperren",
        "Die gewählten Lichter behalten, wie sie sind, wenn das Lichtnetz neu erstellt oder neu gefärbt wird",
    ),
    "vlm.multiply_color": (
        "Farbe multiplizieren",
        "Die Farben der gewählten Lichter Kanal für Kanal multiplizieren",
    ),
    "vlm.open_documentation": (
        "Dokumentation",
        "Das Handbuch öffnen, das mit der Erweiterung kommt; es braucht kein Netz",
    ),
    "vlm.paint_detail": (
        "Detail malen",
        "Auf das sichtbare Netz malen, wo das nächste Lichtnetz mehr Lichter bekommt oder gar keine",
    ),
    "vlm.pair_tags": (
        "Kennungen paaren",
        "Jede Fläche die Lichter auslassen lassen, die für sie stehen, durch Kennungen und Verknüpfungen "
        "neben den vorhandenen; für die gewählten Lichtnetze, auf den gewählten Objekten oder sonst auf "
        "allem, woraus sie gemacht sind. Sekunden für 5.000 Lichter",
    ),
    "vlm.pick_color": (
        "Farbe aufnehmen",
        "Auf eine sichtbare Fläche klicken: Die gewählten Lichter nehmen ihre diffuse Farbe an, gemittelt "
        "über eine Fläche ihrer Größe",
    ),
    "vlm.recolor_from_materials": (
        "Farben aus Materialien",
        "Den gewählten Lichtern die mittlere Farbe der sichtbaren Fläche geben, für die jedes steht; einige "
        "Sekunden für 5.000",
    ),
    "vlm.repair_tags": (
        "Kennungen reparieren",
        "Kopien von Lichtnetzen und Objekten eigene Kennungen geben, wo sie welche mit Fremdem teilen; "
        "Objekte, die eine Kennung ohne eigenes Licht teilen, verlieren sie",
    ),
    "vlm.select_offenders": (
        "Betroffene auswählen",
        "Die Lichtnetze bearbeiten, die dieser Befund der letzten Prüfung nennt; nur seine Flächen sind gewählt",
    ),
    "vlm.set_strength": (
        "Stärke setzen",
        "Faktoren auf alle Lichter der gewählten Lichtnetze; die Farben ihrer Flächen bleiben, wie sie sind",
    ),
    "vlm.shift_hue": (
        "Farbton verschieben",
        "Den Farbton der gewählten Lichter drehen; jedes sendet so viel Licht aus wie zuvor",
    ),
    "vlm.show_light_grid": (
        "Lichtgitter zeigen",
        "Das Lichtgitter neu machen und seine Zellen zeigen: wie viele Lichter zählen, oder wie weit das Licht "
        "abweichen darf",
    ),
    "vlm.show_licences": (
        "Lizenzen",
        "Die Lizenzen der Erweiterung und der mitgelieferten Software auflisten",
    ),
    "vlm.stop_following": (
        "Nicht mehr folgen",
        "Die gewählten Lichtnetze von dem lösen, dem sie folgen; Form und Ort dieses Bildes bleiben",
    ),
    "vlm.tag_thin": (
        "Dünne Flächen kennzeichnen",
        "Dünne Körper und von beiden Seiten sichtbare Flächen finden und ihre Seiten die Lichter auslassen "
        "lassen, die für sie stehen; vorhandene Kennungen bleiben",
    ),
    "vlm.unlink_receiver": (
        "Objekte wieder beleuchten",
        "Die gewählten Lichter die gewählten sichtbaren Objekte wieder beleuchten lassen, oder alle, wenn "
        "keines gewählt ist",
    ),
    "vlm.unlock_lights": (
        "Lichter entsperren",
        "Die gewählten Lichter sich wieder ändern lassen, wenn das Lichtnetz neu erstellt oder neu gefärbt wird",
    ),
}
"""Label and tooltip of each operator."""

BUTTONS = {
    "Light Polygon": "Lichtpolygon",
    "Light Rectangle": "Lichtrechteck",
    "Extrude Lights": "Lichtstreifen",
    "Cut Lights": "Lichter schneiden",
    "Erase Lights": "Lichter radieren",
    "Render Image": "Bild rendern",
    "Select": "Auswählen",
    "Fix": "Beheben",
    "Fix All": "Alles beheben",
}
"""Texts of buttons that differ from their operator's label, and names of tools, by the English ones."""

LABELS = {
    "Animate": "Animieren",
    "Bake": "Backen",
    "By": "Durch",
    "Check": "Prüfen",
    "Color": "Farbe",
    "Create": "Erstellen",
    "Detail": "Detail",
    "Draw": "Zeichnen",
    "Effects": "Effekte",
    "Emission": "Emission",
    "Hue": "Farbton",
    "No light mesh yet": "Noch kein Lichtnetz",
    "None": "Nichts",
    "Overlays": "Überlagerungen",
    "Presets": "Voreinstellungen",
    "Render": "Rendern",
    "Strength": "Stärke",
    "Support": "Hilfe",
    "Tags": "Kennungen",
    "View": "Ansicht",
}
"""Titles of panels and texts in them, by the English ones."""

PROPERTIES = {
    "Ambient occlusion": "Umgebungsverdeckung",
    "Cells": "Zellen",
    "Direct light": "Direktes Licht",
    "Exact Reach": "Genaue Reichweite",
    "Fill": "Füllung",
    "Filter": "Filter",
    "Filter Cosine": "Filterkosinus",
    "Filter Distance": "Filterabstand",
    "Findings": "Befunde",
    "Findings of the last check": "Befunde der letzten Prüfung",
    "Grid": "Gitter",
    "Highlights": "Glanzlichter",
    "In Front": "Im Vordergrund",
    "Indirect light": "Indirektes Licht",
    "Layered materials": "Geschichtete Materialien",
    "Light Budget": "Lichtbudget",
    "Light Grid": "Lichtgitter",
    "Light Mesh Overlays": "Überlagerungen der Lichtnetze",
    "Light mesh reflection": "Spiegelung des Lichtnetzes",
    "Lights": "Lichter",
    "Map reflection": "Spiegelung aus Karten",
    "Max Lights": "Höchstzahl der Lichter",
    "Octree Resolution": "Auflösung des Octrees",
    "Opacity": "Deckkraft",
    "Range": "Reichweite",
    "Reach": "Reichweite",
    "Samples": "Abtastwerte",
    "Screen reflection": "Spiegelung aus dem Bild",
    "Shadows": "Schatten",
    "Shining Side": "Leuchtende Seite",
    "Tag Regions": "Bereiche kennzeichnen",
    "Target Triangles": "Anzahl der Lichter",
    "Technique": "Verfahren",
    "Temporal accumulation": "Zeitliche Mittelung",
    "Tolerance": "Toleranz",
    "Visibility": "Sichtbarkeit",
    "Visibility Cells": "Sichtbarkeitszellen",
    "Visibility Points": "Sichtbarkeitspunkte",
    "Visibility Rays": "Sichtbarkeitsstrahlen",
    "Visibility of lights": "Sichtbarkeit der Lichter",
    "World Lights": "Lichter der Welt",
    "World lights": "Lichter der Welt",
}
"""Names of settings of the scene, the views and operators, by the English ones."""

SENTENCES = {
    "Click corners on a surface, or drag around an area: a virtual light behind it, in its color": (
        "Ecken auf einer Fläche klicken oder einen Bereich umfahren: ein virtuelles Licht dahinter, in ihrer Farbe"
    ),
    "Drag a rectangle on a surface: virtual lights behind it, in its color": (
        "Ein Rechteck auf eine Fläche ziehen: virtuelle Lichter dahinter, in ihrer Farbe"
    ),
    "Drag an edge of a virtual light along a surface: a strip of lights follows": (
        "Eine Kante eines virtuellen Lichts an einer Fläche entlangziehen: Ein Streifen von Lichtern folgt"
    ),
    "Click or drag across virtual lights of the selected light meshes: they are cut in two": (
        "Quer über virtuelle Lichter der gewählten Lichtnetze klicken oder ziehen: Sie werden zerteilt"
    ),
    "Drag over virtual lights of the selected light meshes to delete them": (
        "Über virtuelle Lichter der gewählten Lichtnetze ziehen, um sie zu löschen"
    ),
    "Lights are drawn in Object Mode and in Edit Mode": (
        "Lichter werden im Objektmodus und im Bearbeitungsmodus gezeichnet"
    ),
    "macOS stops at OpenGL 4.1: create, check and bake here, render on Linux or Windows": (
        "macOS endet bei OpenGL 4.1: hier erstellen, prüfen und backen, unter Linux oder Windows rendern"
    ),
    "Blender's Python was not found, so the renderer cannot start: use an official build of Blender": (
        "Blenders Python wurde nicht gefunden, der Renderer startet nicht: eine offizielle Ausgabe von Blender benutzen"
    ),
    "Nothing to make lights from: select the objects that should bounce light": (
        "Nichts, woraus Lichter werden: die Objekte wählen, die Licht zurückwerfen sollen"
    ),
    "The active collection shows no surfaces: click one that holds meshes in the outliner": (
        "Die aktive Sammlung zeigt keine Flächen: im Outliner eine mit Netzen anklicken"
    ),
    "Select the visible mesh first: detail is painted there, not on the light mesh": (
        "Zuerst das sichtbare Netz wählen: Detail wird darauf gemalt, nicht auf dem Lichtnetz"
    ),
    "The scene shows no surfaces: add a mesh (Add > Mesh) or enable an object for rendering": (
        "Die Szene zeigt keine Flächen: ein Netz hinzufügen oder ein Objekt für das Rendern einschalten"
    ),
    "Leave this mode first (Tab, or the menu at the left of the header): light meshes are made in Object Mode": (
        "Zuerst diesen Modus verlassen (Tab oder das Menü links in der Kopfzeile): Lichtnetze werden im Objektmodus "
        "gemacht"
    ),
    "Leave this mode first: lights are changed in Object Mode (all of a light mesh) or Edit Mode (selected)": (
        "Zuerst diesen Modus verlassen: Lichter werden im Objektmodus (alle eines Lichtnetzes) oder im "
        "Bearbeitungsmodus (die gewählten) geändert"
    ),
    "Select a light mesh (collection Virtual Light Meshes), or edit one and select faces": (
        "Ein Lichtnetz wählen (Sammlung Virtual Light Meshes), oder eines bearbeiten und Flächen wählen"
    ),
    "Leave this mode first (Tab): whole light meshes are changed in Object Mode": (
        "Zuerst diesen Modus verlassen (Tab): Ganze Lichtnetze werden im Objektmodus geändert"
    ),
    "Leave this mode first (Tab): tags of whole scenes are repaired in Object Mode": (
        "Zuerst diesen Modus verlassen (Tab): Kennungen ganzer Szenen werden im Objektmodus repariert"
    ),
    "The scene has no virtual light mesh: create one first": "Die Szene hat kein Lichtnetz: zuerst eines erstellen",
    "There are no findings: run Check first, or there is nothing wrong": (
        "Es gibt keine Befunde: zuerst prüfen, oder es ist alles in Ordnung"
    ),
    "The scene has no camera: add one (Add > Camera) and aim it (View > Align View > Align Active Camera)": (
        "Die Szene hat keine Kamera: eine hinzufügen und ausrichten"
    ),
    "Leave this mode first: tags are given in Object Mode (whole objects) or Edit Mode (selected faces)": (
        "Zuerst diesen Modus verlassen: Kennungen werden im Objektmodus (ganze Objekte) oder im Bearbeitungsmodus "
        "(gewählte Flächen) gegeben"
    ),
    "Select light meshes and the objects that they stand for, or edit them and select faces": (
        "Lichtnetze und die Objekte wählen, für die sie stehen, oder sie bearbeiten und Flächen wählen"
    ),
    "There is no light mesh to show: create one first": "Es gibt kein Lichtnetz, das zu zeigen wäre: eines erstellen",
    "Lights reach everywhere: Reach shows something with Lights set to Range (Render)": (
        "Lichter reichen überallhin: Reichweite zeigt etwas, wo Lichter auf Reichweite steht (Rendern)"
    ),
    "No light grid is shown yet: press Show Light Grid": "Noch ist kein Lichtgitter da: Lichtgitter zeigen drücken",
    "Nothing is baked": "Nichts ist gebacken",
    "Nothing is baked: create a light mesh first": "Nichts ist gebacken: zuerst ein Lichtnetz erstellen",
    "Light grid baked earlier: compare to see whether it is up to date": (
        "Das Lichtgitter ist von früher: vergleichen, um zu sehen, ob es noch stimmt"
    ),
    "Light mesh made earlier: compare to see whether it is up to date": (
        "Das Lichtnetz ist von früher: vergleichen, um zu sehen, ob es noch stimmt"
    ),
    "The scene was changed: the bake may be out of date": (
        "Die Szene wurde geändert: Das Gebackene ist vielleicht veraltet"
    ),
    "Out of date:": "Veraltet:",
    "The light grid could not be written beside the file: save elsewhere, or bake again": (
        "Das Lichtgitter konnte nicht neben die Datei geschrieben werden: woanders speichern oder neu backen"
    ),
    "The light grid was not baked to its end: bake it again": (
        "Das Lichtgitter wurde nicht zu Ende gebacken: neu backen"
    ),
    "Up to date": "Auf dem neuesten Stand",
    "Up to date; no light grid is baked": "Auf dem neuesten Stand; kein Lichtgitter ist gebacken",
}
"""What tools and panels say, by the English sentences."""

FINDINGS = {
    "empty": "Das Lichtnetz hat keine Lichter: aus einer Auswahl erstellen oder Lichter zeichnen",
    "not_finite": "Werte, die keine Zahlen sind ({count} Lichter): beheben oder löschen",
    "negative": "Negative Werte ({count} Lichter): Werte von mindestens 0 benutzen",
    "bad_samples": "Proben der sichtbaren Fläche sind keine Zahlen: die Fläche reparieren und neu erstellen",
    "degenerate": "Lichter ohne Fläche ({count}): löschen oder ihre Ecken verschmelzen",
    "non_manifold": "Lichter, die anders als ihre Nachbarn leuchten ({count}): umdrehen",
    "unsampled": "Lichter ohne Fläche vor sich ({count}), die kein Licht erreicht: näher hinter eine rücken",
    "inside_out": "Lichter, die von ihrer Fläche weg leuchten ({count}): umdrehen",
    "in_front": "Lichter vor ihrer Fläche ({count}): dahinter rücken, oder beiden eine Kennung geben",
    "thin": "Lichter vor einem Körper, der zu dünn ist, um dahinter zu liegen ({count}): beiden eine Kennung geben",
    "two_sided": "Lichter für etwas, das auch von hinten zu sehen ist ({count}): beiden eine Kennung geben",
    "overlapping": "Lichter, die auf anderen liegen, sodass sie doppelt zählen ({count}): löschen",
    "bright": "Lichter, die mehr als alles zurückwerfen ({count}): erlaubt; dämpfen, wenn es nicht gemeint ist",
    "lost_tag": "Kennungen, die keine Fläche hat ({count} Lichter): entfernen",
    "left_behind": "Das Lichtnetz steht still, und woraus es gemacht ist, bewegt sich: Quelle folgen benutzen",
}
"""What the check found, by its kind; count: of faces."""
